"""What a watch told when its source ended, beside the diagnosis of the whole recording."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime import limits
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import concluded, follow
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.recordings.recording import Recording

from tests.rig.follower.plants import part_of

SAME_DEGREE = 1e-6
"""By how much a degree may differ."""


@dataclass(frozen=True)
class Followed:
    """A recording, row by row or in blocks: all that was told, and the diagnosis in the end."""

    memory: Memory
    events: tuple[Event, ...]
    diagnosis: Diagnosis


def followed(ruleset: Ruleset, recording: Recording, step: int) -> Followed:
    memory, events = nothing_yet(False), list[Event]()
    for first in range(0, len(recording), step):
        for told in follow(ruleset, memory, part_of(recording, first, first + step)):
            memory = told.memory
            events += told.events
    if (last := concluded(ruleset, memory)) is not None:
        told, memory = last, last.memory
        events += last.events
    return Followed(memory, tuple(events), told.diagnosis)


def differences(ruleset: Ruleset, recording: Recording, step: int) -> list[str]:
    """Where a watch and the diagnosis of the whole recording disagree, in words."""
    whole, found = diagnose(recording, ruleset), followed(ruleset, recording, step)
    said = []
    pairs = list(zip(whole.findings, found.diagnosis.findings, strict=False))
    if len(whole.findings) != len(found.diagnosis.findings):
        said.append(f"{len(whole.findings)} findings, followed {len(found.diagnosis.findings)}")
    said += [
        f"{one.fault.id} {one.degree}, followed {other.fault.id} {other.degree}"
        for one, other in pairs
        if one.fault.id != other.fault.id or abs(one.degree - other.degree) > SAME_DEGREE
    ]
    return [*said, *_untold(whole, found, float(np.median(np.diff(recording.time))))]


def _untold(whole: Diagnosis, found: Followed, interval: float) -> Iterator[str]:
    """Faults of the diagnosis that nobody was told of in time, and told ones that are none.

    It is told by any of the names that fitted about as well.
    """
    withdrawn = {e.episode.id for e in found.events if e.what == "withdrawn"}
    told = {e.episode.id: e.episode for e in found.events if e.episode.kind == "fault"}
    lasting = [one for name, one in told.items() if name not in withdrawn]
    late = limits.PERSISTENCE * interval
    borne_out = set()
    for finding in whole.findings:
        names = {finding.fault.id, *(name for name, _ in finding.alternatives)}
        mine = {
            one.id
            for one in lasting
            if names & {one.subject, *(name for name, _ in one.alternatives)}
            and one.since - late <= finding.until
            and finding.since <= one.until + late
        }
        borne_out |= mine
        if not any(told[name].since <= finding.since + late for name in mine):
            yield f"{finding.fault.id} at {finding.since} was not told"
    yield from (f"{one.subject} was told" for one in lasting if one.id not in borne_out)


def first_rows(recording: Recording, rows: int) -> Recording:
    return replace(
        recording,
        time=recording.time[:rows],
        values={name: column[:rows] for name, column in recording.values.items()},
        segment=recording.segment[:rows],
    )
