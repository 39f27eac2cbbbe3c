"""Join neighbouring stretches with the same verdict into runs, and say which are too brief."""

from collections.abc import Iterator, Set
from itertools import islice

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.threshold import threshold_of
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.isolate import Isolation, accepted
from rulec_runtime.diagnosis.steady.verdict import Verdict
from rulec_runtime.recordings.stationary import Timeline


def runs_of(
    verdicts: list[Verdict], isolation: Isolation, pauses: set[int], slow: Set[int] = frozenset()
) -> Iterator[tuple[str, list[int]]]:
    """Runs of stretches with the same verdict, as (kind, stretches).

    Stretches with a fault belong together as long as one cause is plausible in all of them and the
    degree stays within its bounds. Stretches that cannot show the fault do not interrupt a run;
    those that cannot be judged are reported separately. `pauses` are stretches after a long pause
    of the recording. `slow` ones, in which readings move, say less about a degree: whether a
    settled stretch continues a run is judged by the settled ones before it, if there are any.
    """
    open_runs: dict[str, list[int]] = {}
    for i, verdict in enumerate(verdicts):
        # Blind stretches say nothing, so they do not interrupt a finding.
        track = "blind" if verdict.kind == "blind" else "plant"
        members = open_runs.setdefault(track, [])
        if members and _cannot_see(verdicts, isolation, members, i):
            continue
        if members and (i in pauses or not _continues(verdicts, isolation, members, i, slow)):
            yield verdicts[members[0]].kind, members
            members = open_runs[track] = []
        if track == "plant" and open_runs.get("blind"):
            yield "blind", open_runs.pop("blind")
        members.append(i)
    for members in open_runs.values():
        if members:
            yield verdicts[members[0]].kind, members


def _cannot_see(
    verdicts: list[Verdict], isolation: Isolation, members: list[int], point: int
) -> bool:
    """Whether a stretch that looks healthy is merely unable to show the faults of the run."""
    last = members[-1]
    if verdicts[point].kind != "ok" or verdicts[last].kind != "fault":
        return False
    return all(
        threshold_of(isolation.floor[fault, point]) > isolation.degree[fault, last]
        for fault in verdicts[last].faults
    )


def _continues(
    verdicts: list[Verdict], isolation: Isolation, members: list[int], point: int, slow: Set[int]
) -> bool:
    first, here = verdicts[members[0]], verdicts[point]
    if first.kind != here.kind or len(first.faults) != len(here.faults):
        return False
    if here.kind == "blind":
        return first.text == here.text
    if here.kind != "fault":
        return True
    rests = islice((m for m in reversed(members) if m not in slow), limits.STRETCHES_COMPARED)
    recent = [*rests][::-1] or members[-limits.STRETCHES_COMPARED :]
    common = (isolation.probability[:, [*recent, point]] > limits.JOINS_A_RUN).all(axis=1)
    steady = [i for i in np.flatnonzero(common) if _steady(isolation, int(i), recent, point)]
    return len(steady) >= len(here.faults)


def _steady(isolation: Isolation, fault: int, recent: list[int], point: int) -> bool:
    before = isolation.degree[fault, recent]
    # Neighbouring stretches share systematic errors, so their scatter is the measure, if there are
    # enough of them to have one.
    spread = common.COVERAGE * (before.std() if len(recent) > 2 else isolation.u[fault, point])
    change = abs(isolation.degree[fault, point] - before.mean())
    return bool(change <= spread + common.SAME_DEGREE * before.mean())


def too_brief(evaluated: EvaluatedPoints, timeline: Timeline, members: list[int]) -> bool:
    """Whether a deviation is short, and small enough for the end of a transient."""
    isolation = evaluated.isolation
    strongest = strongest_of(evaluated, members)
    limit = accepted(int(isolation.freedom[strongest]), 0, isolation.chance)
    far = isolation.misfit[strongest] > limits.FAR_BEYOND * limit
    brief = timeline.samples[members].sum() < common.PERSISTENCE
    return bool(brief and not far)


def strongest_of(evaluated: EvaluatedPoints, members: list[int]) -> int:
    """The stretch of a run that fits a healthy plant least."""
    return members[int(np.argmax(evaluated.isolation.misfit[members]))]
