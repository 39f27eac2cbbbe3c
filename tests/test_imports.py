"""Who may import whom, and what the runtime verbs load."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import ROOT, compiled

HEAVY = {"sympy", "yaml", "scipy", "networkx", "jsonschema", "numba"}
OPERATOR_STATION = {"numpy", "rich"}
"""All that the runtime needs; `runtime/mismatch` may use scipy, imported when it is used."""

INTEGRATOR = "runtime/dynamic/machine.py"
"""Compiled by numba where that is installed; loaded when something is integrated."""

CONTRACT = {
    "runtime.ruleset",
    "runtime.plan",
    "runtime.mismatch.candidate",
    "runtime.dynamic.balances",
    "runtime.json_file",
    "runtime.write_file",
}
"""What the compiler writes; `runtime.tangent` differentiates its plans at the reference point."""
FILES = sorted(
    path.relative_to(ROOT).as_posix()
    for package in ("rulec", "runtime")
    for path in (ROOT / package).rglob("*.py")
)


def imports(file: str) -> Iterator[tuple[str, bool]]:
    """Modules that a file imports, also inside functions; second: at the top of the file."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    inside = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, id(node) not in inside
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            module = node.module or ""
            if module in ("rulec", "runtime", "rulec.commands"):
                for alias in node.names:
                    yield f"{module}.{alias.name}", id(node) not in inside
            else:
                yield module, id(node) not in inside


def top(module: str) -> str:
    return module.partition(".")[0]


@pytest.mark.parametrize("file", [f for f in FILES if f.startswith("runtime/")])
def test_runtime_needs_numpy_and_rich_alone(file: str) -> None:
    """No compiler, no sympy, no yaml: an operator station stays small."""
    for module, at_top in imports(file):
        if file.startswith("runtime/mismatch/") and top(module) == "scipy":
            assert not at_top, f"{file}: scipy is imported when it is used"
            continue
        if (file, top(module)) == (INTEGRATOR, "numba"):
            continue
        assert not at_top or f"{module.replace('.', '/')}.py" != INTEGRATOR, file
        assert top(module) in {"runtime", *OPERATOR_STATION, *sys.stdlib_module_names}, module


@pytest.mark.parametrize(
    "file",
    [
        f
        for f in FILES
        if f.startswith("rulec/")
        and not f.startswith("rulec/commands/")
        and f not in ("rulec/cli.py", "rulec/__main__.py")
    ],
)
def test_compiler_knows_the_contract_alone(file: str) -> None:
    """Passes import from the runtime only what they write: the ruleset and its plan."""
    found = {module for module, _ in imports(file) if top(module) == "runtime"}
    assert found <= {*CONTRACT, "runtime.tangent"}
    commands = {m for m, _ in imports(file) if m.startswith(("rulec.commands", "rulec.cli"))}
    assert commands == set()


def test_command_line_imports_commands_when_called() -> None:
    """At the top of `rulec/cli.py` stands nothing that has to be paid for."""
    for module, at_top in imports("rulec/cli.py"):
        assert not at_top or top(module) in sys.stdlib_module_names, module


def loaded(*arguments: str) -> set[str]:
    """Packages that a call of the command has loaded at its end."""
    program = (
        "import sys, atexit\n"
        "atexit.register(lambda: print(*sorted({m.partition('.')[0] for m in sys.modules}),"
        " file=sys.stderr))\n"
        "from rulec.cli import main\n"
        f"sys.exit(main({list(arguments)!r}))\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    call = [sys.executable, "-c", program]
    done = subprocess.run(call, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stderr.splitlines()[-1].split())


def test_help_loads_nothing() -> None:
    """`rulec diagnose --help` answers without numpy even."""
    assert not loaded("diagnose", "--help") & {*HEAVY, "numpy", "rich"}


def test_diagnosing_with_a_ruleset_loads_no_compiler(tmp_path: Path) -> None:
    """Neither sympy nor yaml, scipy, networkx, jsonschema, numba."""
    file = tmp_path / "abc.ruleset.json"
    file.write_text(compiled("abc").to_json(), encoding="utf-8")
    recording = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
    found = loaded("diagnose", str(file), str(recording), "--trace", str(tmp_path / "t.csv"))
    assert not found & HEAVY
    assert {"runtime", "numpy", "rich"} <= found


def test_simulating_what_stores_nothing_loads_no_integrator(tmp_path: Path) -> None:
    """Its compiler alone takes longer than a plant of some modules."""
    file = tmp_path / "abc.ruleset.json"
    file.write_text(compiled("abc").to_json(), encoding="utf-8")
    recording = ROOT / "plants" / "abc" / "examples" / "healthy.csv"
    found = loaded("simulate", str(file), str(recording), "-o", str(tmp_path / "out.csv"))
    assert not found & HEAVY
