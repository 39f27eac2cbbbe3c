"""Events as JSON lines in a file, and the state of a watch in another, without a database."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.event_records import (
    Record,
    form_for,
    json_line,
    other_content,
)
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.output.append_file import Appended
from rulec_runtime.output.json_file import Damaged, parse_json
from rulec_runtime.output.write_file import write_data

_BEGINS = b'{"plant": "'
"""Beginning of each line of ours, also of an unfinished one."""


class LinesFile:
    """A file with a line per event; each is synced to the disk, and none occurs twice.

    Raises `JournalRefused` for a foreign file, or one that another process writes.
    """

    def __init__(self, path: Path) -> None:
        self.address = str(path)
        self._path = path
        self._last: dict[str, int] = {}
        try:
            self._file = self._open()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise JournalRefused(f"{self.address}: {reason}") from None

    def last(self, plant: str) -> int:
        """Number of the last event of a plant; 0 before any."""
        return self._last.get(plant, 0)

    def commit(
        self, plant: str, events: Sequence[Event], state: bytes | None, *, dated: bool
    ) -> None:
        """Add new events; states are not stored. Raises `JournalTrouble` if the disk is full,
        `JournalRefused` for another event with a number that is taken."""
        forms = {event.number: form_for(event, plant, dated) for event in events}
        if not forms:
            return
        try:
            if not self._file.still_there():
                moved, self._file = self._file, self._open()
                moved.close()
            last = self.last(plant)
            if min(forms) <= last:
                for other, record in self._records(self._file):
                    number = record["number"]
                    mine = forms.get(number, record) if other == plant else record
                    if any(mine[name] != record.get(name) for name in ("time", "what", "text")):
                        raise other_content(self.address, plant, number, record, forms[number])
            # Known events that are not in this file are in one that was moved away.
            if new := [n for n in sorted(forms) if n > last]:
                self._file.add("".join(json_line(forms[n]) for n in new))
        except OSError as error:
            raise JournalTrouble(f"{self.address}: {error.strerror or error}") from None
        self._last[plant] = max([last, *new])

    def close(self) -> None:
        """Release the file for other processes."""
        self._file.close()

    def _open(self) -> Appended:
        """Open the file and remove a partial line that a killed process left.

        Raises OSError if it cannot be opened now, `JournalRefused` if it is not ours."""
        try:
            file = Appended(self._path)
        except BlockingIOError:
            raise JournalRefused(f"{self.address}: another process writes into it") from None
        try:
            for plant, record in self._records(file):
                self._last[plant] = max(record["number"], self._last.get(plant, 0))
            half = file.half(len(_BEGINS)).rstrip(b"\0")
            if not _BEGINS.startswith(half):
                raise JournalRefused(
                    f"{self.address}: its last line is no event; name another file"
                )
            file.cut()
        except BaseException:
            file.close()
            raise
        return file

    def _records(self, file: Appended) -> Iterator[tuple[str, Record]]:
        for i, line in enumerate(file.lines(limits.LONGEST_LINE), start=1):
            try:
                if len(line) > limits.LONGEST_LINE:
                    raise Damaged("it is too long")
                record = parse_json(line.decode())
                plant, number, text = record["plant"], record["number"], record["text"]
                if not (type(plant) is type(text) is str and type(number) is int):
                    raise TypeError
            except (Damaged, KeyError, TypeError, ValueError):
                raise JournalRefused(
                    f"{self.address}: line {i} is no event; name another file"
                ) from None
            yield plant, record


class Files:
    """A file of events, and one of the state after them; at least one of the two.

    A sink of an outbox that writes ahead: if the process is killed between the two, the outbox has
    both.
    """

    def __init__(self, lines: LinesFile | None, state: Path | None) -> None:
        self.lines, self.state = lines, state
        self.address = str(state) if lines is None else lines.address

    def commit(
        self, plant: str, events: Sequence[Event], state: bytes | None, *, dated: bool
    ) -> None:
        """Add new events and replace the state. Raises `JournalTrouble` if the disk is full,
        `JournalRefused` for another event with a number that is taken."""
        if self.lines is not None:
            self.lines.commit(plant, events, None, dated=dated)
        if self.state is not None and state is not None:
            try:
                write_data(self.state, state)
            except OSError as error:
                raise JournalTrouble(f"{self.state}: {error.strerror or error}") from None
