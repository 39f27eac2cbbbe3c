"""Events and state that a watch saves, in a journal or in files; waits for a database or disk."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rulec_runtime.commands.watch_sinks import close, waiting_in
from rulec_runtime.live import limits
from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal.acknowledgements import Notes
from rulec_runtime.live.journal.lines import Files, LinesFile
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble, needs
from rulec_runtime.live.journal.sinks import KeptSink, WatchSink
from rulec_runtime.live.limits import PAST
from rulec_runtime.live.moment import Present
from rulec_runtime.output.open_file import bytes_of
from rulec_runtime.output.terminal import say_aside
from rulec_runtime.report.text import counted

if TYPE_CHECKING:
    from rulec_runtime.live.journal.store import Journal


class KeptJournal:
    """A journal with its outbox; `folder` holds what waits, None for memory alone."""

    def __init__(self, journal: Journal, outbox: Outbox, plant: str, folder: Path | None) -> None:
        self._journal, self._outbox, self._plant = journal, outbox, plant
        self.folder = folder
        self.sink: WatchSink = KeptSink(outbox)

    def saved(self) -> tuple[bytes, str] | None:
        """The latest state, from the journal or its outbox, and its place.

        Raises `JournalTrouble` if the database does not answer and nothing waits: it is unknown
        then which events were reported. A read-only database causes an error at the first write.
        """
        left = self._outbox.left  # read first: what is written meanwhile is in the database
        with suppress(JournalTrouble):  # each commit holds the plant as well
            self._journal.hold(self._plant)
        try:
            kept = self._journal.state(self._plant)
        except JournalTrouble:
            if left is None and self._journal.is_there:
                raise
            kept = None
        if left is not None and (kept is None or kept.number < left[0]):
            return left[1], str(self._outbox.file)
        return None if kept is None else (kept.state, self._journal.place)

    def joined_to(self, present: Present, stack: ExitStack) -> Callable[[str, str], None]:
        """Show earlier events and acknowledgements of the journal; returns a function that
        acknowledges, both in the journal and in `present`."""
        try:
            before = list(self._journal.events(self._plant, limit=PAST))
        except JournalTrouble:
            before = []  # `rulec journal` lists its events when it is back
        present.recall([entry.event for entry in before])
        notes = Notes(self._journal, self._outbox, self._plant, say_aside, present.acknowledged)

        def ended() -> None:
            self._outbox.close()  # first: an episode must be there to be acknowledged
            if left := notes.close():
                text = f"{self._journal.place}: {counted(left, 'acknowledgement')} not written"
                kept = notes.file is not None and notes.file.exists()
                say_aside(text + f"; {notes.file} keeps what waits for the next start" * kept)

        stack.callback(ended)

        def acknowledge(episode: str, by: str) -> None:
            if episode not in present.now().acknowledged:
                notes.put(episode, by)
            present.acknowledge(episode, by)

        return acknowledge


def kept_journal(
    where: str, plant: str, folder: Path | None, stack: ExitStack, unwritten: list[str]
) -> KeptJournal:
    """Open a journal; the end of `stack` writes what waits, or adds a message to `unwritten`.

    Raises `JournalRefused` if it is not a journal, or another process watches the plant.
    """
    needs("sqlalchemy", "journal")
    from rulec_runtime.live.journal.store import open_journal

    journal = open_journal(where, patient=True)
    stack.callback(journal.close)
    name = "journal"
    if "://" not in journal.place:
        file = Path(journal.place)
        name, folder = file.name, folder or file.parent
    stack.callback(_released, journal, plant)
    outbox = waiting_in(folder, name, journal, plant)
    stack.callback(close, outbox, unwritten)
    return KeptJournal(journal, outbox, plant, folder)


def _released(journal: Journal, plant: str) -> None:
    with suppress(JournalTrouble):  # the lease expires anyway
        journal.release(plant)


class KeptFiles:
    """Files with their outbox; `folder` holds what waits."""

    def __init__(self, files: Files, outbox: Outbox, plant: str, folder: Path) -> None:
        self._files, self._outbox, self._plant = files, outbox, plant
        self.folder = folder
        self._left = outbox.left  # read first: what is written meanwhile is in the file
        last = 0 if files.lines is None else files.lines.last(plant)
        self.sink: WatchSink = KeptSink(outbox, max(last, outbox.newest), waits=True)

    def saved(self) -> list[tuple[bytes, str]]:
        """Saved states, each with its place; the one with the most events is the latest."""
        state = self._files.state
        found = []
        if state is not None and state.exists():
            found.append((bytes_of(state, limits.LARGEST_STATE), str(state)))
        if state is not None and self._left is not None:
            found.append((self._left[1], str(self._outbox.file)))
        return found

    def ahead(self, number: int) -> list[Event]:
        """Events after a state that ends with this number: a process was killed in between."""
        files = self._files
        if files.lines is None or files.state is None:
            return []
        return files.lines.after(self._plant, number)


def kept_files(
    events: str | None,
    state: str | None,
    plant: str,
    folder: Path | None,
    stack: ExitStack,
    unwritten: list[str],
) -> KeptFiles | None:
    """Open the named files, if any; the end of `stack` writes what waits, or adds a message to
    `unwritten`.

    Raises `JournalRefused` for a foreign file, or one in a folder that does not exist.
    """
    names = [Path(name) for name in (events, state) if name]
    if not names:
        return None
    for file in names:
        if not file.parent.is_dir():
            raise JournalRefused(f"{file}: there is no such folder")
    lines = LinesFile(Path(events)) if events else None
    if lines is not None:
        stack.callback(lines.close)
    folder = folder or names[-1].parent
    files = Files(lines, Path(state) if state else None)
    outbox = waiting_in(folder, names[0].name, files, plant)
    stack.callback(close, outbox, unwritten)
    return KeptFiles(files, outbox, plant, folder)
