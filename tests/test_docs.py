"""Every command of the README, the docs pages and the plants runs, and prints what the page shows.

A block with a `title` is a file that the reader writes; it is written where the page has it.
"""

import ast
import contextlib
import doctest
import importlib
import io
import json
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.cli import main as station

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.limits import UNSURE
from tests.conftest import ROOT, compiled
from tests.written import json_of

BLOCK = re.compile(
    r'^```(?P<kind>\w+)(?: title="(?P<title>.*?)")?\n(?P<text>.*?)^```', re.MULTILINE | re.DOTALL
)


def steps_of(page: Path) -> Iterator[tuple[Path | str, str]]:
    """What the reader of a page does: files with their text, commands with what they print."""
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        if block["title"]:
            yield Path(block["title"]), block["text"]
        if block["kind"] == "console":
            for part in re.split(r"^\$ ", block["text"], flags=re.MULTILINE)[1:]:
                command, _, shown = part.partition("\n")
                yield command, shown


def has_commands(page: Path) -> bool:
    return any(isinstance(step, str) for step, _ in steps_of(page))


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
REPAIR, HOUR, PLAN = "repair-a-model", "first-hour", "plan-an-experiment"
LATER = {
    HOUR: ("mismatch", "experiment", "adopt", "recipe.csv", "compare.py", "repaired"),
    REPAIR: ("healthy.csv", "swapped.csv", "shaking_B.csv", "shaking_B.json"),
    PLAN: ("both.json", "limits.yaml"),
}
"""Commands of a page about these files run in `make prove`, as each searches anew. In every run
several recordings are asked about in test_together.py, limits in test_experiment.py, swapped
columns in test_structure.py, what has no name in test_shape.py."""
NAMING = (".py", ".yaml", ".json", ".md", ".txt")
"""Kinds of files that may name a page."""
PIP = ("--no-deps", "--no-build-isolation", "--no-index", "--quiet", "--target", "site")


def pip(arguments: Sequence[str]) -> int:
    """`pip install` beside the installed packages, without a network."""
    verb, *rest = arguments
    command = [sys.executable, "-m", "pip", verb, *PIP, *rest]
    return subprocess.run(command, check=False, capture_output=True).returncode


def python(arguments: Sequence[str]) -> int:
    runpy.run_path(arguments[0])
    return 0


COMMANDS = {"rulec": main, "rulec-runtime": station, "pip": pip, "python": python}


@pytest.fixture
def _alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_this_process: None) -> None:
    """A page runs in a folder of its own, where what pip installs is found."""
    for name in ("kb", "plants"):
        shutil.copytree(ROOT / name, tmp_path / name)
    (tmp_path / "site").mkdir()
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    importlib.invalidate_caches()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")


NUMBER = re.compile(r"\d+(?:\.\d+)?")
PER_CENT, SHARE = 2.0, 1e-3
"""By how many points a per cent may differ, and by which part another decimal number: machines
round differently, and a search adds it up."""


def _stands_in(line: str, printed: str) -> bool:
    """Is a line printed, with nearly the same numbers?

    >>> found = "or leak (25 %), 3.1 bar."
    >>> _stands_in("leak (24 %), 3.1 bar", found), _stands_in("leak (25 %), 3.2 bar", found)
    (True, False)
    """
    words, numbers = NUMBER.split(_squeezed(line)), NUMBER.findall(_squeezed(line))
    pattern = rf"({NUMBER.pattern})".join(map(re.escape, words))
    slack = [
        PER_CENT if after.startswith(" %") else SHARE * float(n) * ("." in n)
        for n, after in zip(numbers, words[1:], strict=True)
    ]
    found = (zip(numbers, m.groups(), slack, strict=True) for m in re.finditer(pattern, printed))
    return any(all(abs(float(n) - float(m)) <= s for n, m, s in each) for each in found)


def run(page: Path, without: tuple[str, ...]) -> None:
    """Each `$` line exits 0, but for those with a word in `without`, which are not run; each line
    below it stands in what was printed."""
    for step, text in steps_of(page):
        if isinstance(step, Path):
            step.parent.mkdir(parents=True, exist_ok=True)
            step.write_text(text, encoding="utf-8")
        elif not any(word.endswith(without) for word in step.split()):
            printed = _run(step)
            for line in text.splitlines():
                assert _stands_in(line, printed), f"{page.name}: {step}: {line!r} not in {printed}"


@pytest.mark.usefixtures("_alone")
@pytest.mark.parametrize("page", [*filter(has_commands, PAGES)], ids=lambda p: p.stem)
def test_commands_of_a_page_run(page: Path) -> None:
    """Where a model is repaired: of the warm recording the slip of A follows its temperature, 3 %
    per kelvin by the independent truth. Its search is long, so what is told is looked at here."""
    run(page, LATER.get(page.stem, ()))
    if page.stem == REPAIR:
        found = json.loads(Path("warm_A.json").read_text(encoding="utf-8"))
        (effect,) = found["effects"]
        assert ("named", "A.slip-temperature@Q_geo") == (found["verdict"], effect["id"])
        assert effect["parameters"]["b"]["lower"] <= 0.03 <= effect["parameters"]["b"]["upper"]
        assert effect["probability"] > 0.9
        held = found["fit"]["heldout"]
        assert held["repaired"] < 0.8 * held["recalibrated"]
        assert held["gain_interval"][0] > 0.0


@pytest.mark.prove
@pytest.mark.usefixtures("_alone")
@pytest.mark.parametrize("page", [p for p in PAGES if p.stem in LATER], ids=lambda p: p.stem)
def test_all_commands_of_a_page_run(page: Path) -> None:
    """In the first hour the slip that was left out: the day leaves two laws of it open, the planned
    recording names the true one; no sensor is blamed, and the adopted plant is right on data that
    nobody used."""
    run(page, ())
    for file, verdict in (("day.json", "ambiguous"), ("both.json", "named")):
        if page.stem == HOUR:
            found = json.loads(Path(file).read_text(encoding="utf-8"))
            (effect,) = found["effects"]
            named = (found["verdict"], *(effect[k] for k in ("effect", "module", "sort")))
            assert (verdict, "slip-viscosity", "A", "physics") == named
            assert {"slip-temperature"} >= {rival["effect"] for rival in effect["alternatives"]}
            assert effect["parameters"]["m"]["lower"] <= 1.0 <= effect["parameters"]["m"]["upper"]


def _run(command: str) -> str:
    """Standard output of a command of ours, white space squeezed."""
    name, *arguments = shlex.split(command)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert COMMANDS[name](arguments) in (0, UNSURE), command
    return _squeezed(out.getvalue())


def _squeezed(text: str) -> str:
    return " ".join(text.split())


def test_pages_that_are_named_exist() -> None:
    """In code, knowledge, plants, tests, the Makefile; and by links between pages, but for those
    to the reference, which are checked with the site."""
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            linked = target.startswith("reference/") or (page.parent / target).exists()
            assert linked, f"{page.name}: {target}"
    folders = ("rulec", "runtime", "kb", "plants", "tests")
    files = [f for name in folders for f in (ROOT / name).rglob("*") if f.suffix in NAMING]
    named = {
        page
        for file in (*files, ROOT / "Makefile", ROOT / "CHANGELOG.md")
        for page in re.findall(
            r"\bdocs/[\w-]+\.(?:md|yaml|svg|ipynb)\b", file.read_text("utf-8", "replace")
        )
    }
    assert named
    assert [] == sorted(page for page in named if not (ROOT / page).exists())


def test_pages_stay_few_and_short() -> None:
    """What is new replaces something; README and changelog take one screen."""
    lines = {p.name: p.read_text(encoding="utf-8").count("\n") for p in PAGES}
    assert lines.pop("README.md") <= 65
    assert (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").count("\n") <= 60
    assert len(lines) <= 20
    assert sum(lines.values()) <= 3000


def test_what_the_architecture_names_exists() -> None:
    """Each path leads to a file or a folder, from the top or by its end; so tables do. Of `name` in
    `file.py`, the file has a line that defines it."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:[\w.-]+/)*(?:[\w-]+\.(?:py|yaml|json|txt))?)`", text)
    parts = [part for top in ("rulec", "runtime") for part in (ROOT / top).rglob("*")]
    paths = [f"/{part.relative_to(ROOT).as_posix()}" for part in parts]
    for name in filter(None, named):
        ends = any(path.endswith(f"/{name.rstrip('/')}") for path in paths)
        assert ends or (ROOT / name).exists(), name
    defined = re.findall(r"`(\w+)` in `([\w./-]+\.py)`", text)
    assert defined
    for name, file in defined:
        line = rf"^(def {name}\(|class {name}\b|{name}\b.* = )"
        source = (ROOT / file).read_text(encoding="utf-8")
        assert re.search(line, source, re.MULTILINE), f"{file}: no {name}"


READMES = sorted((ROOT / "plants").glob("*/README.md"))
PLANTED = re.compile(r"^\*\*Planted:\*\* `(\S+)`", re.MULTILINE)


@pytest.mark.parametrize("page", READMES, ids=lambda page: page.parent.name)
def test_a_plant_is_clean_and_its_readme_right(
    page: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A plant to begin with is clean, compiles, and its README tells what diagnose says: one
    finding, which is what was planted or has it among the causes that fit."""
    assert [] == collect([page.parent])
    assert page.parent.name == compiled(page.parent.name).plant
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("COLUMNS", "120")
    ((command, shown),) = (step for step in steps_of(page) if isinstance(step[0], str))
    (finding,) = json_of(*shlex.split(command)[1:])["findings"]
    printed = _squeezed(capsys.readouterr().out)
    assert all(_squeezed(line) in printed for line in shown.splitlines())
    assert finding["fault"] in shown.splitlines()[0]
    others = [*finding["alternatives"], *finding["remote"]]
    planted = PLANTED.search(page.read_text(encoding="utf-8"))
    assert planted is not None
    assert planted[1] in {finding["fault"], *(other["fault"] for other in others)}


def test_page_and_notebook_of_python_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every line of the page below a prompt is what Python says; every code cell of the
    notebook runs, in order, and what a cell shows is HTML for a notebook."""
    monkeypatch.chdir(ROOT)
    flags = doctest.ELLIPSIS
    page = str(ROOT / "docs" / "use-from-python.md")
    failed, tried = doctest.testfile(page, module_relative=False, optionflags=flags)
    assert 0 == failed
    assert tried > 10
    monkeypatch.chdir(ROOT)
    shown = outputs_of(ROOT / "docs" / "rulec-from-python.ipynb")
    assert all(hasattr(part, "_repr_html_") for part in shown)
    pages = [str(part._repr_html_()) for part in shown]
    assert 7 == len(pages)
    assert any(
        "A: the pump delivers 20 % less than its characteristic predicts" in page for page in pages
    )
    assert "The columns B.dp and C.dp are swapped" in pages[-2]


def outputs_of(file: Path) -> list[Any]:
    """What the cells of a notebook show: the value of the last line, where that is one."""
    outputs: dict[str, Any] = {}
    shown = []
    for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        assert [] == cell["outputs"]
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, file.name, "exec"), outputs)
        if isinstance(last, ast.Expr):
            shown.append(eval(compile(ast.Expression(last.value), file.name, "eval"), outputs))
    return shown
