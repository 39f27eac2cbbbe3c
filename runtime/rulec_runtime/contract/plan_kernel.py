"""Machine code of a plan: made once it pays, kept for the next start, same numbers as numpy.

The work done so far decides: code kept by an earlier start is loaded early; new code is made when
numpy has worked about as long as making it takes. So no run takes much longer than without, and
long ones are several times faster.
"""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits
from rulec_runtime.contract import plan_code
from rulec_runtime.contract.plan_code import Layout, Step, code_of, is_loop, layout_of
from rulec_runtime.machine_code import code as code_lines
from rulec_runtime.machine_code.code import LANES, LINE
from rulec_runtime.machine_code.engine import (
    ONE_AT_A_TIME,
    loaded,
    made_for,
    object_of,
    there_is_llvm,
)
from rulec_runtime.output.private_folder import HAS_OWNERS, keep, kept

Array = NDArray[np.float64]
Function = Callable[[int, int, int, int], None]

_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64)
_IN_USE: dict[str, tuple[Function, ...]] = {}
"""By name: code that this process has loaded; it stays as long as the process."""


class PlanKernel:
    """The steps of a plan for given inputs with samples; `targets` are the values wanted."""

    def __init__(
        self, steps: Sequence[Step], inputs: Sequence[int], targets: Mapping[int, str]
    ) -> None:
        self._steps, self._inputs, self._targets = steps, inputs, targets
        self._work = 0
        self._tried = self._refused = False
        self._functions: tuple[Function, ...] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy starts anew: machine code belongs to one process."""
        return PlanKernel, (self._steps, self._inputs, self._targets)

    def run(
        self, fixed: Sequence[Any], out: Mapping[str, Array] | None, n: int
    ) -> dict[str, Array] | None:
        """Targets by name, shape (n,), written to `out` if given; None where numpy has to do it.

        `fixed` are values before the first step: arrays of `n` samples, and numbers.
        """
        self._work += len(self._steps) * (n + limits.PLAN_CALL)
        if self._functions is None:
            self._functions = self._worth()
        if self._functions is None or n == 0:
            return None
        layout = self._layout
        numbers = np.array([fixed[i] for i in layout.numbers], dtype=float)
        given = [fixed[i] for i in layout.inputs]
        if any(array.shape != (n,) for array in given):
            return None
        if n <= limits.PLAN_TILE and (out is None or n < LANES):
            return self._run_few(given, out, numbers, n)
        made = [np.empty(n) if out is None else out[name] for name in self._targets.values()]
        if not all(array.shape == (n,) and array.flags.carray for array in made):
            return None
        arrays = [*map(np.ascontiguousarray, given), *made]
        at = np.array([a.__array_interface__["data"][0] for a in arrays], dtype=np.int64)
        if (np.abs(at[: len(given), None] - at[len(given) :]) < arrays[0].nbytes).any():
            return None  # the outputs would overwrite the inputs
        self._run_tiles(arrays, at, numbers, n)
        return dict(zip(self._targets.values(), made, strict=True))

    def _run_few(
        self, given: Sequence[Array], out: Mapping[str, Array] | None, numbers: Array, n: int
    ) -> dict[str, Array]:
        """Run few samples, padded in two tables: one address is cheaper than many."""
        width = -(-n // LANES) * LANES
        inputs, made = np.ones((len(given), width)), np.empty((len(self._targets), width))
        for row, array in zip(inputs, given, strict=True):
            row[:n] = array
        self._run_tiles(
            [*inputs, *made], np.concatenate((_rows(inputs), _rows(made))), numbers, width
        )
        found = dict(zip(self._targets.values(), made[:, :n], strict=True))
        if out is None:
            return found
        for name, array in found.items():
            out[name][...] = array
        return {name: out[name] for name in found}

    def _run_tiles(
        self, arrays: list[Array], at: NDArray[np.int64], numbers: Array, n: int
    ) -> None:
        """Run over arrays of at least `LANES` samples, which begin at these addresses."""
        layout = self._layout
        tile = n // LANES * LANES
        if len(layout.parts) > 1:
            tile = min(tile, limits.PLAN_TILE)
        # Rows that begin a power of two apart would evict each other from the cache.
        rows = np.empty((layout.rows, tile + LINE))
        arrays, at = [*arrays, *rows], np.concatenate((at, _rows(rows)))
        # The last tile may overlap the one before: it gives the same numbers.
        for low in (*range(0, n - tile, tile), n - tile):
            self._run_tile(arrays, at, numbers, low, low + tile)

    def _run_tile(
        self, arrays: Sequence[Array], at: NDArray[np.int64], numbers: Array, low: int, high: int
    ) -> None:
        """Run all parts on samples few enough to stay in the cache."""
        layout = self._layout
        assert self._functions is not None
        functions = iter(self._functions)
        where, values = at.ctypes.data, numbers.ctypes.data

        def view(value: int) -> Any:
            place = layout.place.get(value)
            if place is None:
                return numbers[layout.numbers.index(value)]
            return arrays[place][low:high] if place < layout.arrays else arrays[place][: high - low]

        for part in layout.parts:
            if is_loop(part):
                next(functions)(where, values, low, high)
                continue
            ((function, a, b, value),) = part
            operands = (view(a),) if b < 0 else (view(a), view(b))
            function(*operands, out=view(value))

    @cached_property
    def _layout(self) -> Layout:
        return layout_of(self._steps, self._inputs, list(self._targets))

    def _worth(self) -> tuple[Function, ...] | None:
        """The functions, if the work so far justifies them."""
        if self._refused or self._work < limits.KEPT_CODE_WORTH or not there_is_llvm():
            return None
        make = self._work > limits.PLAN_CODE_WORTH * len(self._steps) + limits.KEPT_CODE_WORTH
        if self._tried and not make:
            return None
        self._tried = True
        try:
            return _functions(self._steps, self._layout, make)
        except (ImportError, OSError, RuntimeError):  # this LLVM does not know the machine
            self._refused = True
            return None


def _functions(steps: Sequence[Step], layout: Layout, make: bool) -> tuple[Function, ...] | None:
    """Functions of all loops: those in use, those kept, or new ones if `make`."""
    key = _key(steps, layout)
    name = f"plan_{key}"
    with ONE_AT_A_TIME:
        if name not in _IN_USE:
            data = kept(f"{key}.code") if HAS_OWNERS else None
            if data is None and make:
                data = object_of(code_of(layout, name))
                if HAS_OWNERS:
                    keep(f"{key}.code", data)
            if data is None:
                return None
            names = [f"{name}_{i}" for i, part in enumerate(layout.parts) if is_loop(part)]
            _IN_USE[name] = tuple(_FUNCTION(address) for address in loaded(data, names))
        return _IN_USE[name]


def _key(steps: Sequence[Step], layout: Layout) -> str:
    """Hash of all that the code depends on: operations, this machine, and the code generator."""
    operations = [(f.__name__, a, b, value) for f, a, b, value in steps]
    what = (operations, layout.inputs, layout.targets, limits.PLAN_LOOP, _writer(), made_for())
    return hashlib.sha256(repr(what).encode()).hexdigest()


@cache
def _writer() -> str:
    files = [Path(module.__file__ or "") for module in (plan_code, code_lines)]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def _rows(table: Array) -> NDArray[np.int64]:
    return table.ctypes.data + table.strides[0] * np.arange(len(table), dtype=np.int64)
