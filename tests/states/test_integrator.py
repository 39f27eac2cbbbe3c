"""The integrator: values against LSODA, derivatives, limits; machine code gives the same bits."""

import functools
import mmap
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
import rulec_runtime.simulation.integrator as machine
import rulec_runtime.simulation.kernel as kernel
from rulec_runtime.contract.plan import OPERATIONS, UNARY, Array, Plan
from rulec_runtime.contract.ruleset import Dynamics
from rulec_runtime.simulation.balances import TIME, Balances, Course
from rulec_runtime.simulation.kernel_code import EVALUATE, evaluate_code_of
from rulec_runtime.simulation.kernel_rules import Numbers
from rulec_runtime.simulation.tape import tape_of

from rulec.passes.pipeline import compile_plant
from tests.conftest import compiled
from tests.states.plants import FEED, SHIPPED, STORE, plant_in, random_inputs, two_tanks

LIVELY = {**SHIPPED, "k": 4e-6, "a": 0.1e-4, "h0": 0.08}
"""Tanks that run empty within a few samples."""


@functools.cache
def tanks() -> tuple[Dynamics, Balances]:
    """The two tanks, ready to be integrated."""
    dynamics = compiled("cascaded-tanks").dynamics
    assert dynamics is not None
    return dynamics, balances_of(dynamics)


def balances_of(dynamics: Dynamics) -> Balances:
    states = tuple(s.id for s in dynamics.states)
    shown = tuple(f"shown:{name}" for name in dynamics.outputs)
    return Balances(dynamics.plan, states, dynamics.inputs, shown)


def values_of(by_hand: Mapping[str, float]) -> dict[str, float]:
    """Values written by hand as inputs of the plan; the sensors have no offset."""
    names = {"A": "A", "a": "a", "g": "gain", "h0": "h0", "gravity": "gravity"}
    both = {f"{m}.{n}": by_hand[key] for m in ("upper", "lower") for n, key in names.items()}
    return {"pump.k": by_hand["k"], **both}


def run(time: Array, u: Array, values: Mapping[str, float], *seeds: str) -> Course:
    return tanks()[1].run(time, u[:, None], np.array([True]), values, seeds)


def lower(course: Course) -> Array:
    return course.shown[:, tanks()[1].outputs.index("shown:lower.y")]


@pytest.mark.parametrize(
    ("by_hand", "volts"), [(SHIPPED, 1e-5), (LIVELY, 1e-3)], ids=["shipped", "lively"]
)
def test_two_tanks_as_another_solver_has_them(by_hand: Mapping[str, float], volts: float) -> None:
    """Random steps of the voltage: LSODA from sample to sample."""
    time, u = random_inputs(seed=0)
    found = lower(run(time, u, values_of(by_hand)))
    np.testing.assert_allclose(found, two_tanks(time, u, by_hand), rtol=0, atol=volts)


def test_limits_hold(tmp_path: Path) -> None:
    """A tank that runs empty is never below its lower limit; a store with a wall keeps what it
    can, and at the wall its level follows the wall alone. No number is lost there, derivatives
    included."""
    time = 4.0 * np.arange(150)
    u = np.where((time > 100) & (time < 400), 0.0, 3.0)
    course = run(time, u, values_of(SHIPPED), "upper.a", "pump.k", "upper.h0")
    assert np.isfinite(course.slopes).all()
    assert 0.0 <= course.states.min() < 1e-6
    levels = course.states[:, 0]
    assert levels[(time > 300) & (time < 400)].max() < 1e-6
    assert levels[-1] > 0.1
    np.testing.assert_allclose(lower(course), two_tanks(time, u), rtol=0, atol=1e-3)
    modules = {"P": "feed", "T": "store"}
    store = compile_plant(plant_in(tmp_path, modules, "P -> T", feed=FEED, store=STORE)).dynamics
    assert store is not None
    time, u = np.arange(0.0, 200.0, 10.0), np.full((20, 1), 2.0)
    u[12:] = -1.0
    values = {**store.values, "T.top": 0.55}
    course = balances_of(store).run(time, u, np.array([True]), values, ("T.top", "T.h0"))
    rise = np.minimum(0.5 + 1e-3 * time, 0.55)
    fall = 0.55 - 0.5e-3 * np.maximum(time - 120.0, 0.0)
    np.testing.assert_allclose(course.states[:, 0], np.minimum(rise, fall), atol=1e-12)
    at_wall = time >= 60
    np.testing.assert_array_equal(course.slopes[:, 0, 0], np.where(at_wall, 1.0, 0.0))
    np.testing.assert_array_equal(course.slopes[:, 0, 1], np.where(at_wall, 0.0, 1.0))


SEEDS = ("pump.k", "upper.A", "upper.a", "upper.h0", "lower.A", "lower.a", "lower.g", "lower.h0")


@pytest.mark.parametrize("by_hand", [SHIPPED, LIVELY], ids=["shipped", "lively"])
def test_derivatives_are_those_of_differences(by_hand: Mapping[str, float]) -> None:
    """By each parameter, carried along, against central differences of the whole run."""
    time, u = random_inputs(120)
    values = values_of(by_hand)
    slopes = run(time, u, values, *SEEDS).slopes
    for i, name in enumerate(SEEDS):
        step = 1e-5 * values[name]
        above, below = (
            run(time, u, {**values, name: values[name] + side * step}).shown for side in (1, -1)
        )
        expected = (above - below) / (2.0 * step)
        size = np.abs(expected).max()
        np.testing.assert_allclose(slopes[:, :, i], expected, rtol=0, atol=2e-4 * size)


def test_the_same_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where numba is not installed Python runs the same lines."""
    if not hasattr(machine.integrate, "py_func"):
        pytest.skip("numba is not installed")
    time, u = random_inputs(25)
    fast = run(time, u, values_of(SHIPPED), "upper.a", "lower.h0")
    for name, found in vars(machine).copy().items():
        if hasattr(found, "py_func"):
            monkeypatch.setattr(machine, name, found.py_func)
    slow = run(time, u, values_of(SHIPPED), "upper.a", "lower.h0")
    assert fast.steps == slow.steps
    np.testing.assert_allclose(slow.shown, fast.shown, rtol=1e-13)
    np.testing.assert_allclose(slow.slopes, fast.slopes, rtol=1e-10)


def test_operations_are_those_of_plans() -> None:
    """Each gives what numpy gives, and its derivatives by both operands."""
    names = list(OPERATIONS)
    operations = [(name, 0, 0 if name in UNARY else 1) for name in names]
    plan = Plan(
        ("A.a", "A.b", "A.h"),
        (0.0,),
        tuple(operations),
        {**{name: 4 + i for i, name in enumerate(names)}, "der:A.h": 3, "start:A.h": 3},
    )
    balances = Balances(plan, ("A.h",), (), tuple(names))
    time, inputs, held = np.arange(2.0), np.empty((2, 0)), np.empty(0, dtype=bool)
    for a, b in ((0.7, 0.3), (0.3, 0.7), (1.7, 2.0)):
        values = {"A.a": a, "A.b": b}
        course = balances.run(time, inputs, held, values, ("A.a", "A.b"))
        for i, name in enumerate(names):
            assert course.shown[1, i] == pytest.approx(_by_numpy(name, a, b), rel=1e-14), name
            for j, (da, db) in enumerate(((1e-6, 0.0), (0.0, 1e-6))):
                above, below = (_by_numpy(name, a + s * da, b + s * db) for s in (1, -1))
                slope = (above - below) / 2e-6
                assert course.slopes[1, i, j] == pytest.approx(slope, rel=1e-6, abs=1e-8), name


def _by_numpy(name: str, a: float, b: float) -> float:
    return float(OPERATIONS[name](a) if name in UNARY else OPERATIONS[name](a, b))


HELD = np.array([True])
BY_HAND = ("pump.k", "upper.A", "upper.a", "lower.A", "lower.a", "upper.h0", "lower.h0")


def fresh(balances: Balances) -> Balances:
    """The same balances, nothing of them made yet."""
    return Balances(balances.plan, balances.states, balances.inputs, balances.outputs)


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Iterator[Course]]:
    """A run by the interpreter, and the same by machine code, which is made by numba's LLVM."""
    pytest.importorskip("numba")

    def run(balances: Balances, *arguments: object) -> Iterator[Course]:
        for worth in (np.inf, 0):
            monkeypatch.setattr(kernel, "KERNEL_WORTH", worth)
            own = fresh(balances)
            yield own.run(*arguments)  # type: ignore[arg-type]
            assert bool(own._kernels.made) == (worth == 0)

    return run


def assert_same(first: Course, second: Course) -> None:
    assert first.steps == second.steps
    for name in ("shown", "slopes", "states"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), name)


@pytest.mark.parametrize("seeds", [(), SEEDS[:1], BY_HAND, SEEDS], ids=len)
@pytest.mark.parametrize("by_hand", [SHIPPED, LIVELY], ids=["shipped", "lively"])
def test_two_tanks(
    both: Callable[..., Iterator[Course]], by_hand: dict[str, float], seeds: Sequence[str]
) -> None:
    """With few columns and many, with steps that are cut or implicit and without."""
    time, u = random_inputs()
    assert_same(*both(tanks()[1], time, u[:, None], HELD, values_of(by_hand), seeds))


@functools.cache
def of_all() -> Balances:
    """One state, two inputs and the clock, on which each operation works, and a dead time."""
    inputs = ("A.a", "A.b", "A.h", "u", "v", TIME)
    operations: list[tuple[str, int, int]] = [("mul", 0, 2), ("add", 1, 3), ("mul", 4, 5)]
    for name in OPERATIONS:
        operations.append((name, 7, 7 if name in UNARY else 8))
    first = 10
    names = list(OPERATIONS)
    sums = [first + names.index(n) for n in ("min", "tanh", "sqrt", "pow")]
    last = first + len(names)
    operations += [("add", sums[0], sums[1]), ("add", last, sums[2]), ("add", last + 1, sums[3])]
    operations += [("sub", last + 2, 2), ("add", last + 3, 9)]
    outputs = {name: first + i for i, name in enumerate(names)}
    outputs |= {"der:A.h": last + 4, "start:A.h": 1, "low:A.h": 6}
    plan = Plan(inputs, (-3.0,), tuple(operations), outputs)
    return Balances(plan, ("A.h",), ("u", "v"), tuple(names))


@pytest.mark.parametrize(
    ("a", "b"), [(0.7, 0.3), (2.0, -0.5), (-1.0, 0.2), (0.0, 1.0)], ids=lambda v: f"{v:g}"
)
def test_all_operations(both: Callable[..., Iterator[Course]], a: float, b: float) -> None:
    """Each of them, at edges too, with inputs that are held and inputs in lines."""
    time = 0.1 * np.arange(40)
    inputs = np.column_stack([np.sin(time), np.cos(time)])
    values, held = {"A.a": a, "A.b": b}, np.array([True, False])
    assert_same(*both(of_all(), time, inputs, held, values, ("A.a", "A.b")))


def test_functions_take_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """An analysis makes thousands; each keeps its code alone, and an address of its own."""
    pytest.importorskip("numba")
    statm = Path("/proc/self/statm")
    if not statm.is_file():
        pytest.skip("memory is read as Linux tells it")
    monkeypatch.setattr(kernel, "KERNEL_WORTH", 0)

    def pages() -> int:
        return int(statm.read_text(encoding="ascii").split()[1])

    fresh(tanks()[1])._kernels.kernel(0)
    before, found = pages(), set()
    for _ in range(30):
        found |= set(fresh(tanks()[1])._kernels.kernel(0))
    assert len(found) == 3 * 30
    assert (pages() - before) * mmap.PAGESIZE < 3 * 30 * 200e3


def test_code_holds_numbers_of_slots_alone() -> None:
    """Whatever the names of a plan are: code is made of numbers."""
    names = ('x"; ret void', "}\ndefine void @evil()", "%values")
    plan = Plan(names, (), (("add", 0, 1), ("mul", 3, 2)), {f"der:{names[0]}": 4})
    codes = []
    for own in (names, ("a", "b", "c")):
        named = Plan(own, (), plan.operations, {f"der:{own[0]}": 4, f"start:{own[0]}": 1})
        tape, _ = tape_of(named, own[:1], own[1:2], ())
        numbers = Numbers(1e-14, 300.0, (0.0, 0.5, 0.5, 1.0), (0.1, 0.2, 0.3, 0.4), {})
        codes.append(evaluate_code_of(tape, (), 4, numbers))
    assert codes[0] == codes[1]
    assert f"define void @{EVALUATE}" in codes[0]
