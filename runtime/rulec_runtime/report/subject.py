"""The subject of a page: a plant, and perhaps a recording of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.plant_calendar import Calendar, duration, span
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import counted


@dataclass(frozen=True, kw_only=True)
class Subject:
    """A plant, and name, number of samples, first and last time (s), and dates of a recording."""

    ruleset: Ruleset
    recording: str = ""
    samples: int = 0
    ends: tuple[float, float] | None = None
    calendar: Calendar | None = None

    @staticmethod
    def of(ruleset: Ruleset, recording: Recording, name: str) -> Subject:
        """A named recording; one joined from several clocks has no ends."""
        time = recording.time
        timed = len(time) > 0 and recording.origin is None
        return Subject(
            ruleset=ruleset,
            recording=name,
            samples=len(recording),
            ends=(float(time[0]), float(time[-1])) if timed else None,
            calendar=recording.calendar,
        )

    def facts(self) -> Iterator[tuple[str, str]]:
        """Terms and texts for the head of a page."""
        yield "Plant", f"{self.ruleset.plant}: {self.ruleset.title}"
        if self.recording:
            yield "Recording", self.recording
        if self.ends is not None:
            long = duration(self.ends[1] - self.ends[0])
            when = span(self.calendar, *self.ends)
            yield "Span", f"{when} ({long}), {counted(self.samples, 'sample')}"
        yield "Ruleset", f"made of sources with the hash {self.ruleset.sources}"
