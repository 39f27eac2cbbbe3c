"""Machine code of plans: to the last bit what numpy gives, kept in a folder that is the user's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from rulec_runtime import limits
from rulec_runtime.contract import plan_kernel
from rulec_runtime.contract.plan import OPERATIONS, UNARY, Array, Operation, Plan
from rulec_runtime.contract.plan_code import RULES
from rulec_runtime.machine_code import engine
from rulec_runtime.machine_code.code import LANES
from rulec_runtime.output import private_folder

from tests.conftest import compiled

pytest.importorskip("numba", reason="machine code is made by numba's LLVM")

PLANTS = ("abc", "esp-pump", "hsy-pumping", "power-unit", "wastewater-lab", "zema-hydraulic")
MOST = 1200
"""Operations of a plan in a test; of longer ones the degrees of rules are left out."""
BAD = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, -1e-300)


@pytest.fixture(autouse=True)
def _nothing_in_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_kernel, "_IN_USE", {})


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where code is kept in this test."""
    monkeypatch.setenv("RULEC_CACHE", str(tmp_path / "cache"))
    private_folder._say.cache_clear()
    return tmp_path / "cache" / "plants"


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Code is made at the first run."""
    monkeypatch.setattr(limits, "KEPT_CODE_WORTH", 0)
    monkeypatch.setattr(limits, "PLAN_CODE_WORTH", 0)


@pytest.fixture
def made(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Code that was made, not loaded."""
    found: list[str] = []

    def noted(code: str) -> bytes:
        found.append(code)
        return engine.object_of(code)

    monkeypatch.setattr(plan_kernel, "object_of", noted)
    return found


def by_numpy(plan: Plan, values: Mapping[str, Any]) -> dict[str, Array]:
    """The same plan anew, without machine code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(limits, "KEPT_CODE_WORTH", np.inf)
        return anew(plan).run(values)


def anew(plan: Plan) -> Plan:
    return Plan(plan.inputs, plan.constants, plan.operations, plan.outputs)


def has_code(plan: Plan) -> bool:
    return all(s.kernel._functions is not None for s in plan._schedules.values() if s.steps)


def assert_same(found: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
    assert list(found) == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, name)
        finite = np.isfinite(values) & (values == 0)
        assert (np.signbit(found[name]) == np.signbit(values))[finite].all(), name


def drawn(random: np.random.Generator, n: int) -> Any:
    """Numbers of many sizes and both signs, one in eight bad."""
    values = random.standard_normal(n) * 10.0 ** random.integers(-3, 4, n)
    bad = random.random(n) < 0.125
    values[bad] = random.choice(BAD, bad.sum())
    return values


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("plant", PLANTS)
def test_plants(plant: str) -> None:
    """All outputs, from readings near their references and from anything at all."""
    rules, random = compiled(plant), np.random.default_rng(1)
    reference = {s.id: s.reference for s in rules.signals}
    for whole in (rules.plan, rules.undo):
        names = list(whole.outputs)
        if len(whole.operations) > MOST:
            names = [n for n in names if not n.startswith(("x:", "ux:"))]
        plan, n = anew(whole.select(names)), 2 * limits.PLAN_TILE + 3
        sizes = dict(zip(plan.inputs, random.uniform(0, 2, len(plan.inputs)), strict=True))
        near = {k: v * random.uniform(0.9, 1.1, n) for k, v in reference.items()}
        for read in (near, {name: drawn(random, n) for name in reference}):
            values = {name: read.get(name, size) for name, size in sizes.items()}
            assert_same(plan.run(values), by_numpy(plan, values))
        assert has_code(plan)


def random_plan(random: np.random.Generator, names: Sequence[str], count: int) -> Plan:
    """Each operation reads any values before it; every third is an output.

    What min and max give of two zeros is not defined, so nothing divides by it.
    """
    inputs, constants = ("a", "b", "c", "d"), (2.0, -0.5, 0.0)
    first = len(inputs) + len(constants)
    read = list(range(first))
    operations: list[Operation] = []
    for i in range(first, first + count):
        name = str(random.choice(names))
        a, b = (int(random.choice(read[-12:])) for _ in "ab")
        operations.append((name, a, 0 if name in UNARY else b))
        if name not in ("min", "max"):
            read.append(i)
    outputs = {f"y{i}": i for i in range(first, first + count, 3)}
    return Plan(inputs, constants, tuple(operations), {**outputs, "same": first, "input": 0})


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", ["all", "code alone"])
def test_any_plan(seed: int, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All operations, in loops that are cut and tiles that overlap; roots of what is below zero."""
    monkeypatch.setattr(limits, "PLAN_LOOP", 7)
    monkeypatch.setattr(limits, "PLAN_TILE", 3 * LANES)
    random = np.random.default_rng(seed)
    names = [n for n, f in OPERATIONS.items() if kind == "all" or f in RULES]
    plan = random_plan(random, names, 80)
    for n in (1, 2, LANES, 3 * LANES - 1, 3 * LANES, 10 * LANES + 1):
        values: dict[str, Any] = {x: drawn(random, n) for x in "abc"}
        values["d"] = float(random.standard_normal())
        found = plan.run(values)
        expected = by_numpy(plan, values)
        np.testing.assert_equal({k: v + 0.0 for k, v in found.items()}, expected)
        out = {name: np.full(n, 7.0) for name in plan.outputs}
        assert all(v is out[k] for k, v in plan.run(values, out).items())
        np.testing.assert_equal(out, expected)
    assert has_code(plan)


PLAN = Plan(
    ("a", "b", "u"), (3.0,), (("mul", 0, 1), ("add", 4, 3), ("div", 5, 2)), {"x": 5, "y": 6}
)


def inputs(n: int) -> dict[str, Any]:
    return {"a": np.arange(n) - 2.0, "b": np.linspace(-1, 1, n), "u": 0.0}


@pytest.mark.usefixtures("at_once")
def test_any_memory() -> None:
    """Every second sample, one that is repeated, arrays written over; and no samples at all."""
    n, plan = 1000, anew(PLAN)
    values = inputs(n)
    expected = by_numpy(plan, values)
    wide = np.repeat(np.asarray(values["a"]), 2)
    assert_same(plan.run({**values, "a": wide[::2]}), expected)
    table = np.empty((n, 2))
    plan.run(values, {"x": table[:, 0], "y": table[:, 1]})
    assert_same(dict(zip("xy", table.T, strict=True)), expected)
    one = np.broadcast_to(2.5, (n,))
    assert_same(plan.run({**values, "b": one}), by_numpy(plan, {**values, "b": 2.5}))
    over: Array = np.arange(float(n)) - 2.0
    plan.run({**values, "a": over}, {"x": over, "y": np.empty(n)})
    np.testing.assert_array_equal(over, expected["x"])
    assert [0, 0] == [len(v) for v in plan.run(inputs(0)).values()]
    longer = np.full(n + 1, 7.0)
    plan.run(values, {"x": longer, "y": np.empty(n)})
    np.testing.assert_array_equal(longer, [*expected["x"], 7.0])


def test_code_is_made_when_it_pays(made: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Not for a small job; for many of them, or for one that is long."""
    monkeypatch.setattr(limits, "KEPT_CODE_WORTH", 3 * 30_000)
    monkeypatch.setattr(limits, "PLAN_CODE_WORTH", 20_000)
    many, long = anew(PLAN), anew(PLAN)
    for _ in range(40):
        many.run(inputs(1))
    assert (made, has_code(many)) == ([], False)
    for _ in range(2):
        many.run(inputs(1))
    long.run(inputs(60_000))
    assert has_code(many)
    assert has_code(long)
    assert len(made) == 1  # both plans are the same


@pytest.mark.usefixtures("at_once")
@pytest.mark.skipif(not private_folder.HAS_OWNERS, reason="files have no owners here")
def test_code_is_kept_for_the_next_start(
    folder: Path, made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whole and of this user alone; another machine, or another writer, makes its own."""

    def next_start() -> Plan:
        plan_kernel._IN_USE.clear()
        plan = anew(PLAN)
        assert_same(plan.run(inputs(100)), by_numpy(plan, inputs(100)))
        assert has_code(plan)
        return plan

    for _ in range(2):
        next_start()
    (file,) = folder.iterdir()
    assert len(made) == 1
    assert (folder.stat().st_mode & 0o777, file.stat().st_mode & 0o777) == (0o700, 0o600)
    whole = file.read_bytes()
    for damage in (b"", whole[:-1], whole[:-1] + b"x", b"x" * 1000):
        file.write_bytes(damage)
        next_start()
        assert file.read_bytes() == whole
    file.chmod(0o622)
    next_start()
    assert len(made) == 6
    monkeypatch.setattr(plan_kernel, "made_for", lambda: "another")
    next_start()
    monkeypatch.setattr(plan_kernel, "_writer", lambda: "another")
    next_start()
    assert (len(made), len(list(folder.iterdir()))) == (8, 3)


@pytest.mark.usefixtures("at_once", "made")
@pytest.mark.parametrize("error", [OSError, RuntimeError, ImportError])
def test_without_llvm_numpy_does_it(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    """numba is not installed, or its LLVM knows no such machine."""
    plan, expected = anew(PLAN), by_numpy(PLAN, inputs(100))
    monkeypatch.setattr(plan_kernel, "object_of", Mock(side_effect=error))
    assert_same(plan.run(inputs(100)), expected)
    assert not has_code(plan)
    monkeypatch.setattr(plan_kernel, "there_is_llvm", lambda: False)
    assert_same(anew(PLAN).run(inputs(100)), expected)


def test_code_has_no_name_of_the_ruleset(at_once: None, made: list[str]) -> None:
    """Names of a ruleset are what somebody else wrote."""
    names = ("evil", "%at", "}\n define")
    plan = Plan(names, (1.0,), PLAN.operations, {f"{name}!": i for i, name in enumerate(names, 4)})
    plan.run(dict.fromkeys(names, np.arange(8.0)))
    assert all(name not in made[0] for name in ("evil", "!", names[2]))
    assert set(made[0].split("define void @plan_")[1].split("(")[0]) <= set("0123456789abcdef_")
