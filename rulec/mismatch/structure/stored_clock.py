"""Columns of a plant that stores whose clock is off, where no plant can do the same.

A reading that answers late may have a dead time, and a flow that acts late a way to go: both are
entries of the catalogue, and are left to the search of physics. A reading that answers before its
cause, and a flow that acts before it is there, are clocks.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.mending import Mending
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch import limits as common
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement, Compared
from rulec.mismatch.structure.clock_offset import Shift, longest, nearest, pace_of, sizes_of

Judge = Callable[[Recording, int], Agreement]
"""How well a recording agrees with the plain model, refitted in so many steps."""


def shifts_against_cause(
    recording: Recording, ruleset: Ruleset, judge: Judge
) -> tuple[list[Shift], int]:
    """Shifts of single columns that agree better, and how many were tried."""
    dynamics = ruleset.dynamics
    assert dynamics is not None
    plain = judge(recording, limits.STRUCTURE_STEPS)
    if plain.gross < limits.GROSS_SHARE:
        return [], 1
    before = judge(recording, 0).likelihood
    sides = dict.fromkeys(dynamics.inputs, 1) | dict.fromkeys(dynamics.outputs, -1)
    # What is less than two samples of a simulation hardly shows in it.
    least = 2 * -(-len(recording) // common.SAMPLE_BUDGET)
    sizes = [by for by in sizes_of(recording) if by >= least]
    if not sizes:
        return [], 1

    def gain(name: str, by: int) -> float:
        return judge(_read(recording, name, by), 0).likelihood - before

    best: dict[str, tuple[float, int]] = {}
    for name in (n for n in sides if n in recording.values):
        # A little of what is right is better than nothing: without a first sign none is tried.
        if gain(name, sides[name] * sizes[0]) > 0.0:
            best[name] = max((gain(name, sides[name] * by), sides[name] * by) for by in sizes)
    order = sorted((n for n in best if best[n][0] > 0.0), key=lambda n: -best[n][0])
    found = []
    for name in order[: limits.STRUCTURE_REFITTED]:
        by = nearest(partial(gain, name), best[name][1], longest(recording))
        # What stands on the side of a cause is left to the catalogue.
        if by * sides[name] > 0:
            found.append(_judged(recording, name, by, judge, plain))
    return found, max(len(sizes) * len(best), 1)


def _read(recording: Recording, name: str, by: int) -> Recording:
    """The recording with a column read `by` samples later."""
    return Mending(signals=(name,), late=by * pace_of(recording)).of(recording)


def _judged(recording: Recording, name: str, by: int, judge: Judge, plain: Agreement) -> Shift:
    """What a shift gains with the plain model refitted; one sample less or more may be better."""

    def compared(at: int) -> Compared:
        there = judge(_read(recording, name, at), limits.STRUCTURE_STEPS)
        # What stands beyond the ends of the file was not lost by being wrong.
        return Compared(plain, replace(there, rows=plain.rows))

    near = {at: compared(at) for at in (by - 1, by, by + 1) if at}
    by = max(near, key=lambda at: near[at].gain)
    return Shift(signals=(name,), by=by, gain=near[by].gain, left=near[by].left)
