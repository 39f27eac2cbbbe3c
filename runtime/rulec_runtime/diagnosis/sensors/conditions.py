"""Conditions of an invalid reading, by NE 107, and what to do about them."""

from dataclasses import dataclass

from rulec_runtime.contract.ruleset import SignalSpec
from rulec_runtime.recordings.columns import median_of
from rulec_runtime.recordings.plant_calendar import ENDED
from rulec_runtime.recordings.recording import Recording


@dataclass(frozen=True)
class Condition:
    """A way in which a reading is invalid. `status` is the letter of NE 107: F if the device has
    failed, C if the record does not match its header."""

    name: str
    status: str
    title: str
    action: str


DEAD = Condition(
    "dead",
    "F",
    "Reading that is dead",
    "check supply, cable and fuse of the sensor; if they are right, whether anything flows at all",
)
STUCK = Condition(
    "stuck",
    "F",
    "Reading that is stuck",
    "check the sensor, its transmitter and the data link; if they are right, the logger",
)
RANGE = Condition(
    "range",
    "F",
    "Reading that its sensor cannot show",
    "check cable, supply and scaling of the sensor (NE 43: a broken wire reads below the live "
    "zero, a short circuit above the end of the range), and the range in its module type",
)
SATURATED = Condition(
    "saturated",
    "C",
    "Reading at the end of its range",
    "compare the range of the transmitter with what the plant can reach; if that is less, check "
    "its scaling",
)
UNIT = Condition(
    "unit",
    "C",
    "Reading in another unit than its header says",
    "correct the unit in the header of the column, or in the column map",
)
SWAPPED = Condition(
    "swapped",
    "C",
    "Two columns that are swapped",
    "swap the two titles in the header, or in the column map; check the wiring if the logger "
    "wrote them so",
)
CLOCK = Condition(
    "jump",
    "C",
    "Clock that was set",
    "check the clock of the logger, and let it write dates with their zone",
)
REPEATED = Condition(
    "repeated",
    "C",
    "Times that repeat",
    "let the logger write seconds, or fractions of them; a spreadsheet that saved the file may "
    "have dropped them; if they are there, check its clock",
)


@dataclass(frozen=True, kw_only=True)
class SensorFinding:
    """An invalid reading over a period; times in s.

    `signal` is empty for the clock. `text` names reading and reason. `mended` says how the column
    was corrected for the rest of the diagnosis; if empty, its readings were removed.
    """

    condition: Condition
    signal: str
    since: float
    until: float
    text: str
    behind: str | None = ENDED
    probability: float = 1.0
    mended: str = ""

    @property
    def id(self) -> str:
        """As for faults: place, then what is wrong there."""
        return f"{self.signal or 'time'}.{self.condition.name}"

    @property
    def active(self) -> bool:
        """Whether it lasted to the end."""
        return self.behind is not ENDED

    @property
    def module(self) -> str:
        """Module of the sensor."""
        return self.signal.partition(".")[0]


Found = tuple[SensorFinding, slice]
"""A finding with its samples."""


def found_in(
    recording: Recording, rows: slice, condition: Condition, signal: str, text: str
) -> Found:
    """A reading that is invalid in some rows."""
    since, until = (float(recording.time[i]) for i in (rows.start, rows.stop - 1))
    finding = SensorFinding(condition=condition, signal=signal, since=since, until=until, text=text)
    return finding, rows


def stuck_in(recording: Recording, rows: slice, signal: SignalSpec, because: str) -> Found:
    """A reading that does not move."""
    shown = signal.shown(float(recording.values[signal.id][rows.start]))
    text = f"{signal.id} is stuck at {shown:.6g} {signal.unit}: {because}"
    return found_in(recording, rows, STUCK, signal.id, text)


def dead_in(recording: Recording, rows: slice, signal: SignalSpec, because: str) -> Found:
    """A reading at zero."""
    shown = signal.shown(median_of(recording.values[signal.id][rows]))
    text = f"{signal.id} is dead: it reads {shown:.3g} {signal.unit} although {because}"
    return found_in(recording, rows, DEAD, signal.id, text)
