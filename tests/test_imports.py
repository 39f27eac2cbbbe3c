"""Who may import whom, by folder, and what the commands load."""

import ast
import functools
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.conftest import ROOT, SOURCES, compiled

HEAVY = {"sympy", "yaml", "scipy", "networkx", "jsonschema", "numba"}
OPERATOR_STATION = {"numpy", "rich"}
"""All that the runtime needs."""
EXTRAS = {"asyncua", "cryptography", "paho", "yaml", "starlette", "uvicorn", "h11", "sqlalchemy"}
"""Of the runtime: for sources, journal and page, loaded where they are asked for."""
FORMATS = {"pyarrow", "openpyxl", "scipy", "h5py", "asammdf", "nptdms"}
"""Of its readers, each loaded when a file of its format comes."""
FETCHED = ("rulec_runtime.fleet", "fsspec")
"""Loaded where recordings of a fleet are elsewhere."""
READERS = "rulec_runtime.recordings.readers"
INTEGRATOR = "rulec_runtime.simulation.integrator"
"""Compiled by numba where that is installed; loaded when something is integrated."""


ROOMS = (
    "rulec_runtime.limits", "rulec_runtime.output", "rulec_runtime.contract",
    "rulec_runtime.recordings", "rulec_runtime.recordings.readers",
    "rulec_runtime.simulation", "rulec_runtime.diagnosis.steady", "rulec_runtime.diagnosis.stores",
    "rulec_runtime.diagnosis.sensors", "rulec_runtime.diagnosis", "rulec_runtime.report",
    "rulec_runtime.fleet", "rulec_runtime.live", "rulec_runtime.live.sources",
    "rulec_runtime.live.journal", "rulec_runtime.live.view", "rulec_runtime.commands",
    "rulec_runtime", "rulec.limits", "rulec.engines", "rulec.language", "rulec.knowledge",
    "rulec.algebra", "rulec.simulation", "rulec.passes", "rulec.effects", "rulec.calibration",
    "rulec.curves", "rulec.study", "rulec.export", "rulec.separation", "rulec.fleet",
    "rulec.mismatch.limits", "rulec.mismatch.result", "rulec.mismatch.evidence",
    "rulec.mismatch.evidence.steady", "rulec.mismatch.evidence.stores",
    "rulec.mismatch.structure", "rulec.mismatch.search", "rulec.mismatch.experiment",
    "rulec.mismatch.inference", "rulec.mismatch.answer", "rulec.mismatch",
    "rulec.demo", "rulec.mtp", "rulec.commands", "rulec", "rulec.prove", "rulec.prove.real",
)  # fmt: skip
"""From the ground up: a file may import from its own room and from those above it in this list."""

CONTRACT = {"rulec_runtime.contract", "rulec_runtime.output", "rulec_runtime.limits"}
COMPILER = {"rulec.limits", "rulec.language", "rulec.knowledge", "rulec.algebra", "rulec.passes"}
STORED = "rulec_runtime.simulation.balances"
"""What is stored stands in the ruleset as a plan in the form that the integrator reads."""

MODULES = {
    ".".join(file.relative_to(top).with_suffix("").parts).removesuffix(".__init__"): file
    for top, package in ((ROOT, "rulec"), (ROOT / "runtime", "rulec_runtime"))
    for file in sorted((top / package).rglob("*.py"))
    if "truth" not in file.relative_to(top).parts  # shares no code with the tool
}
"""All modules of the product and where they stand."""


@functools.cache
def imports(module: str) -> list[tuple[str, bool]]:
    """Modules that one imports, also inside functions or for types alone; second: at the top."""
    return list(_imports(ast.parse(MODULES[module].read_text(encoding="utf-8")), module, True))


def _imports(tree: ast.AST, module: str, at_top: bool) -> Iterator[tuple[str, bool]]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, at_top) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            source = node.module or ""
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                yield inner if inner in MODULES else source, at_top
        else:
            inside = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
            inside |= isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
            yield from _imports(node, module, at_top and not inside)


def room_of(module: str) -> str:
    return module if module in ROOMS else module.rpartition(".")[0]


def top(module: str) -> str:
    return module.partition(".")[0]


def test_arrows_run_downwards() -> None:
    """Every file has a room, no circle is between folders, and the runtime knows nothing of the
    compiler. No module imports itself by way of others, not even inside a function."""
    assert {room_of(module) for module in MODULES} == set(ROOMS)
    climbs = [
        (module, found)
        for module in MODULES
        for found, _ in imports(module)
        if found in MODULES and ROOMS.index(room_of(found)) > ROOMS.index(room_of(module))
    ]
    assert climbs == []
    left = {m: {found for found, _ in imports(m) if found in MODULES} - {m} for m in MODULES}
    while ends := {m for m, found in left.items() if not found & left.keys()}:
        left = {m: found for m, found in left.items() if m not in ends}
    assert left == {}


def test_runtime_needs_numpy_and_rich_alone() -> None:
    """No compiler, no sympy, no yaml: an operator station stays small.

    What runs beside the plant may need an extra; such files, and those that need them, are loaded
    when they are asked for, and so by no command at its top.
    """
    allowed = {"rulec_runtime", *OPERATOR_STATION, *sys.stdlib_module_names}
    runtime = [m for m in MODULES if top(m) == "rulec_runtime"]
    at_top = {m: {found for found, here in imports(m) if here} for m in runtime}
    extra = {m for m in runtime if any(top(found) in EXTRAS for found in at_top[m])}
    while more := {m for m in runtime if at_top[m] & extra} - extra:
        extra |= more
    assert {room_of(m) for m in extra} <= {m for m in ROOMS if m.startswith("rulec_runtime.live.")}
    for module in runtime:
        live = module.startswith("rulec_runtime.live.")
        for found, here in imports(module):
            assert not (here and found == INTEGRATOR), module
            fine = top(found) in allowed or (live and top(found) in EXTRAS)
            fine |= room_of(module) == READERS and top(found) in FORMATS
            fine |= (room_of(module), top(found), here) == (*FETCHED, False)
            assert fine or (module == INTEGRATOR and top(found) == "numba"), module


def test_some_modules_import_little() -> None:
    """Nobody imports a reader: the registry of formats loads it when a file asks for it. Passes
    import from the runtime only what they write: the ruleset and its plan. At the top of
    command lines stands nothing that has to be paid for."""
    for module in MODULES:
        if room_of(module) != READERS:
            assert not [found for found, _ in imports(module) if found.startswith(READERS)], module
    for module in (m for m in MODULES if room_of(m) in COMPILER):
        for found, _ in imports(module):
            fine = room_of(found) in CONTRACT or found == STORED
            assert fine or top(found) != "rulec_runtime", (module, found)
    for module in ("rulec.cli", "rulec_runtime.cli", "rulec_runtime.commands.frame"):
        for found, at_top in imports(module):
            free = top(found) in sys.stdlib_module_names or found.endswith("commands.frame")
            assert not at_top or free, module


def loaded(*arguments: str, package: str = "rulec", code: int = 0) -> set[str]:
    """Packages that a call of the command has loaded at its end."""
    program = (
        "import sys, atexit\n"
        "atexit.register(lambda: print(*sorted({m.partition('.')[0] for m in sys.modules}),"
        " file=sys.stderr))\n"
        f"from {package}.cli import main\n"
        f"sys.exit(main({list(arguments)!r}))\n"
    )
    environment = {**os.environ, "PYTHONPATH": SOURCES}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == code, done.stderr
    return set(done.stderr.splitlines()[-1].split())


def test_diagnosing_with_a_ruleset_loads_no_compiler(tmp_path: Path) -> None:
    """Neither sympy nor yaml, scipy, networkx, jsonschema, numba; the runtime not even rulec. Nor
    does simulating what stores nothing load an integrator; help answers without numpy even."""
    file = tmp_path / "abc.ruleset.json"
    file.write_text(compiled("abc").to_json(), encoding="utf-8")
    recording = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
    asked = ("diagnose", str(file), str(recording), "--trace", str(tmp_path / "t.csv"))
    for package in ("rulec", "rulec_runtime"):
        found = loaded(*asked, package=package)
        assert not found & (HEAVY | FORMATS)
        assert {package, "rulec_runtime", "numpy", "rich"} <= found
    assert "rulec" not in found
    simulate = ("simulate", str(file), str(recording), "-o", str(tmp_path / "out.csv"))
    assert not loaded(*simulate) & HEAVY
    assert not loaded("diagnose", "--help") & {*HEAVY, "numpy", "rich"}
