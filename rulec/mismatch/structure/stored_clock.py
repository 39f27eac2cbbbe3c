"""Columns of a plant that stores with a wrong clock, where no plant behaves like that.

A late reading may have a dead time, and a flow with a late effect a transport time: the catalogue
has entries for both, and the search for physics handles them. A reading that answers before its
cause, and a flow that acts before it exists, have a wrong clock.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch import limits as common
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement, Compared
from rulec.mismatch.structure.clock_offset import Shift, longest, nearest, pace_of, sizes_of

Judge = Callable[[Recording, int], Agreement]
"""How well a recording agrees with the plain model, refitted in a number of steps."""


def shifts_against_cause(
    recording: Recording, ruleset: Ruleset, judge: Judge
) -> tuple[list[Shift], int]:
    """Shifts of single columns that agree better, and the number tried."""
    dynamics = ruleset.dynamics
    assert dynamics is not None
    plain = judge(recording, limits.STRUCTURE_STEPS)
    if plain.gross < limits.GROSS_SHARE:
        return [], 1
    before = judge(recording, 0).likelihood
    sides = dict.fromkeys(dynamics.inputs, 1) | dict.fromkeys(dynamics.outputs, -1)
    # Less than two samples of a simulation hardly show in it.
    least = 2 * -(-len(recording) // common.SAMPLE_BUDGET)
    sizes = [by for by in sizes_of(recording) if by >= least]
    if not sizes:
        return [], 1

    def gain(name: str, by: int) -> float:
        return judge(_read(recording, name, by), 0).likelihood - before

    best: dict[str, tuple[float, int]] = {}
    for name in (n for n in sides if n in recording.values):
        # A small part of the right shift improves the agreement; if it does not, none is tried.
        if gain(name, sides[name] * sizes[0]) > 0.0:
            best[name] = max((gain(name, sides[name] * by), sides[name] * by) for by in sizes)
    order = sorted((n for n in best if best[n][0] > 0.0), key=lambda n: -best[n][0])
    found = []
    for name in order[: limits.STRUCTURE_REFITTED]:
        by = nearest(partial(gain, name), best[name][1], longest(recording))
        # Effects after their cause are left to the catalogue.
        if by * sides[name] > 0:
            found.append(_judged(recording, name, by, judge, plain))
    return found, max(len(sizes) * len(best), 1)


def _read(recording: Recording, name: str, by: int) -> Recording:
    return Mending(signals=(name,), late=by * pace_of(recording)).of(recording)


def _judged(recording: Recording, name: str, by: int, judge: Judge, plain: Agreement) -> Shift:
    """The gain of a shift with the plain model refitted; one sample less or more may be better."""

    def compared(at: int) -> Compared:
        there = judge(_read(recording, name, at), limits.STRUCTURE_STEPS)
        # Comparisons beyond the ends of the file are no loss of the hypothesis.
        return Compared(plain, replace(there, rows=plain.rows))

    near = {at: compared(at) for at in (by - 1, by, by + 1) if at}
    by = max(near, key=lambda at: near[at].gain)
    return Shift(signals=(name,), by=by, gain=near[by].gain, left=near[by].left)
