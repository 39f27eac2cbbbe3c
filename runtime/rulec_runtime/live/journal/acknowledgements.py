"""Acknowledgements on their way to the journal and back."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from threading import Condition, Thread
from typing import TYPE_CHECKING

from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.outbox import Note, notes_beside, spill_notes, waiting_notes
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble

if TYPE_CHECKING:
    from rulec_runtime.live.journal.outbox import Outbox
    from rulec_runtime.live.journal.store import Journal


class Notes:
    """Writes acknowledgements in its own thread, so that nobody waits for the database.

    `put` first saves them in a file beside that of the outbox, so they survive the process; those
    of an earlier process are written first. `seen` gets the ids of all acknowledged episodes of the
    plant, including those acknowledged by `rulec journal`: at once, and after each change. An
    acknowledgement waits while the events of its episode wait in the outbox. Raises
    `JournalRefused` if the file cannot be read.
    """

    def __init__(
        self,
        journal: Journal,
        outbox: Outbox,
        plant: str,
        say: Callable[[str], None],
        seen: Callable[[frozenset[str]], None],
    ) -> None:
        self._journal, self._outbox, self._plant = journal, outbox, plant
        self._say, self._seen = say, seen
        self.file = None if outbox.file is None else notes_beside(outbox.file)
        left = () if self.file is None else waiting_notes(self.file, plant)
        self._waiting = deque(left)
        self._known: frozenset[str] | None = None
        self._closing = False
        self._changed = Condition()
        seen(frozenset(note.episode for note in left))
        self._thread = Thread(target=self._run, name="notes", daemon=True)
        self._thread.start()

    def put(self, episode: str, by: str) -> None:
        """Acknowledge an episode; returns at once."""
        with self._changed:
            if all(episode != note.episode for note in self._waiting):
                self._waiting.append(Note(episode, by, time.time()))
                self._keep()
            self._changed.notify_all()

    def close(self) -> int:
        """Write what waits if the database answers; returns how many could not be written."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join(limits.BUSY + limits.CONNECT)
        return len(self._waiting)

    def _run(self) -> None:
        while True:
            with self._changed:
                closing = self._closing
            wait = limits.RENEWED
            with suppress(JournalTrouble):  # retried later; the outbox reports it
                wait = self._write()
                known = self._journal.acknowledged(self._plant)
                if known != self._known:
                    self._known = known
                    self._seen(known)
            if closing:
                return
            with self._changed:
                if not self._closing:
                    self._changed.wait(wait)

    def _write(self) -> float:
        """Write what waits, one by one; returns the s until the next attempt."""
        for _ in range(len(self._waiting)):
            note = self._waiting[0]
            try:
                self._journal.acknowledge(self._plant, note.episode, note.by, note.at)
            except JournalRefused as error:
                if self._outbox.pending:
                    return limits.FIRST_RETRY
                self._say(str(error))
            with self._changed:
                self._waiting.popleft()
                self._keep()
        return limits.RENEWED

    def _keep(self) -> None:
        if self.file is not None:
            with suppress(OSError):  # if this disk is full as well, memory still has everything
                spill_notes(self.file, self._plant, self._waiting)
