"""The journal of a watch: held for this process, patient while its database is gone."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rulec_runtime.commands.watch_sinks import close, waiting_in
from rulec_runtime.live.journal.notes import Notes
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalTrouble, needs
from rulec_runtime.live.journal.sinks import KeptSink, WatchSink
from rulec_runtime.live.view.limits import PAST
from rulec_runtime.live.view.present import Present
from rulec_runtime.output.terminal import say_aside
from rulec_runtime.report.text import counted

if TYPE_CHECKING:
    from rulec_runtime.live.journal.store import Journal


class KeptJournal:
    """A journal with what waits for it; `folder` is where that is kept, None for memory alone."""

    def __init__(self, journal: Journal, outbox: Outbox, plant: str, folder: Path | None) -> None:
        self._journal, self._outbox, self._plant = journal, outbox, plant
        self.folder = folder

    @property
    def sink(self) -> WatchSink:
        """Where events and states go."""
        return KeptSink(self._outbox)

    def saved(self) -> tuple[bytes, str] | None:
        """The latest state, in the journal or what waits for it, and where that is.

        Raises `JournalTrouble` if the database does not answer and nothing waits: nobody knows
        then which events were told. One that can be read alone is told of when it is written.
        """
        left = self._outbox.left  # before the database: what is written meanwhile stands there
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
        """Show what the journal knows of earlier events and acknowledgements; gives what takes
        further ones, for the journal and whoever looks."""
        try:
            before = list(self._journal.events(self._plant, limit=PAST))
        except JournalTrouble:
            before = []  # its events are listed by `rulec journal` when it is back
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
    """Open a journal; at the end of `stack` what waits is written, or put into `unwritten`.

    Raises `JournalRefused` where it is none, or where another process watches the plant.
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
    with suppress(JournalTrouble):  # its place is free when the lease is over
        journal.release(plant)
