"""Events and state in two files, for one who needs no database."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal.lines import LinesFile
from rulec_runtime.live.journal.refused import JournalTrouble
from rulec_runtime.output.write_file import write_data


class Files:
    """Lines of events, then the file of the state behind them; at least one of the two.

    A sink of an outbox: each is on the disk when `commit` returns. After a kill between the two
    the next watch catches up with the events.
    """

    def __init__(self, lines: LinesFile | None, state: Path | None) -> None:
        self.lines, self.state = lines, state
        self.place = str(state) if lines is None else lines.place
        """What it is, for people."""

    def commit(
        self, plant: str, events: Sequence[Event], state: bytes | None, *, dated: bool
    ) -> None:
        """Add what is not there yet. Raises `JournalTrouble` where the disk is full,
        `JournalRefused` for another event of a number that is taken."""
        if self.lines is not None:
            self.lines.commit(plant, events, None, dated=dated)
        if self.state is not None and state is not None:
            try:
                write_data(self.state, state)
            except OSError as error:
                raise JournalTrouble(f"{self.state}: {error.strerror or error}") from None
