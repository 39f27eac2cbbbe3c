"""What a watch tells of a recording until its source ends."""

from dataclasses import dataclass, replace

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import follow
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.recordings.recording import Recording

from tests.rig.follower.plants import part_of


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
    return Followed(memory, tuple(events), told.diagnosis)


def first_rows(recording: Recording, rows: int) -> Recording:
    return replace(
        recording,
        time=recording.time[:rows],
        values={name: column[:rows] for name, column in recording.values.items()},
        segment=recording.segment[:rows],
    )
