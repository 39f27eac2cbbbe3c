# Two commands for a bare machine with Python 3.11 or newer: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# Matrices are small: threads of the linear algebra, and of trees, would only wait for each other.
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1
# Without bytecode each process that a test starts would compile all modules again.
unexport PYTHONDONTWRITEBYTECODE
.DEFAULT_GOAL := help
comma := ,
.PHONY: help demo demo-live test prove bench goals figures golden docs clean

help: ## list the commands
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/'

# pip would compile every module on one core. Not compiled before is what no test imports: the tests
# that packages bring, tools to install, mypy (machine code), what learns (make prove), lexers,
# fonts, databases.
UNUSED := /(tests?|pip|setuptools|pkg_resources|mypyc?|sklearn|pygments/lexers|fontTools|sqlalchemy)/
define install
	@test -x $(BIN)/pip || $(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install --quiet --disable-pip-version-check --no-compile \
		--editable ./runtime --editable '$(1)'
	@$(BIN)/python -m compileall -qq -j 0 -x '$(UNUSED)' $(VENV)/lib rulec runtime || true
endef

$(BIN)/rulec: pyproject.toml runtime/pyproject.toml
	@echo "preparing $(VENV) (once, about a minute)"
	$(call install,.)
	@touch $@

# All at once: what is installed twice is resolved twice.
$(VENV)/dev: pyproject.toml runtime/pyproject.toml
	@echo "preparing $(VENV) for tests (once, about a minute)"
	$(call install,.[dev])
	@touch $(BIN)/rulec $(VENV)/watch $@

demo: $(BIN)/rulec ## see a leakage found and explained on a shipped example
	@$(BIN)/rulec demo

$(VENV)/watch: $(BIN)/rulec
	$(call install,.[watch])
	@touch $@

demo-live: $(VENV)/watch ## a whole plant on this machine, watched while it runs; a minute
	@$(BIN)/rulec demo --live

test: $(VENV)/dev ## lint, types, all tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@# Types are checked beside the first tests: alone they would leave a core idle.
	$(BIN)/mypy & types=$$!; \
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder; tests=$$?; \
	wait $$types && exit $$tests

prove: $(VENV)/dev ## what takes long: more sealed cases, whole rigs (about ten minutes)
	$(BIN)/python -m pytest -n 2 -m prove

$(VENV)/bench: $(VENV)/dev
	$(call install,.[dev$(comma)bench])
	@touch $@

bench: $(VENV)/bench ## speed beside peers, as ratios (some minutes)
	$(BIN)/python -m tests.bench

goals: $(VENV)/dev ## speed against goals: compile, a million samples, start of the command
	$(BIN)/python -m pytest tests/bench -s

figures: $(VENV)/dev ## measure all printed figures again (hours); ONLY='zema isolation' takes some
	$(BIN)/python -m tests.figures measure $(if $(ONLY),--only $(ONLY))

golden: $(VENV)/dev ## re-make golden files; review them as a diff
	RULEC_REMAKE=1 $(BIN)/python -m pytest tests/test_golden.py tests/test_errors.py \
		tests/runtime/test_words.py

$(VENV)/docs: $(BIN)/rulec
	@$(BIN)/pip install --quiet --disable-pip-version-check --editable ./runtime --editable '.[docs]'
	@touch $@

docs: $(VENV)/docs ## the pages as a site, in build/docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict --config-file docs/site/mkdocs.yml
	@echo "open build/docs/index.html; the search needs a server: python3 -m http.server -d build/docs"

clean: ## remove everything that was made
	rm -rf $(VENV) build/docs .mypy_cache .ruff_cache .pytest_cache
