"""Machine code of tapes: to the last bit what the interpreter gives."""

import functools
import mmap
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
import rulec_runtime.simulation.kernel as kernel
from rulec_runtime.contract.plan import OPERATIONS, UNARY, Plan
from rulec_runtime.simulation.balances import TIME, Balances, Course
from rulec_runtime.simulation.kernel_code import EVALUATE, evaluate_code_of
from rulec_runtime.simulation.kernel_rules import Numbers
from rulec_runtime.simulation.tape import tape_of

from tests.states.plants import SHIPPED, random_inputs
from tests.states.test_integrator import LIVELY, SEEDS, tanks, values_of

pytest.importorskip("numba", reason="machine code is made by numba's LLVM")

HELD = np.array([True])
BY_HAND = ("pump.k", "upper.A", "upper.a", "lower.A", "lower.a", "upper.h0", "lower.h0")


def fresh(balances: Balances) -> Balances:
    """The same balances, nothing of them made yet."""
    return Balances(balances.plan, balances.states, balances.inputs, balances.outputs)


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Iterator[Course]]:
    """A run by the interpreter, and the same by machine code."""

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
