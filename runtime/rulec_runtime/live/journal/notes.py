"""Acknowledgements on their way to the journal and back: who took note of what, and when."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from threading import Condition, Thread
from typing import TYPE_CHECKING

from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble

if TYPE_CHECKING:
    from rulec_runtime.live.journal.outbox import Outbox
    from rulec_runtime.live.journal.store import Journal


class Notes:
    """Writes in a thread of its own, so nobody who acknowledges waits for the database.

    `seen` gets the ids of all episodes of the plant that somebody has taken note of, also by
    `rulec journal`: at once, and again when they have changed. An episode that is not in the
    journal yet is waited for, as long as its events wait in the outbox.
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
        self._waiting: deque[tuple[str, str, float]] = deque()
        self._known: frozenset[str] | None = None
        self._closing = False
        self._changed = Condition()
        self._thread = Thread(target=self._run, name="notes", daemon=True)
        self._thread.start()

    def put(self, episode: str, by: str) -> None:
        """Somebody takes note of an episode now; returns at once."""
        with self._changed:
            if all(episode != other for other, _, _ in self._waiting):
                self._waiting.append((episode, by, time.time()))
            self._changed.notify_all()

    def close(self) -> int:
        """Write what waits if the database answers; how many could not be written."""
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
            with suppress(JournalTrouble):  # tried again later; the outbox tells of it
                wait = self._write()
                self._read()
            if closing:
                return
            with self._changed:
                if not self._closing:
                    self._changed.wait(wait)

    def _write(self) -> float:
        """What waits, one by one; s until it makes sense to try again."""
        for _ in range(len(self._waiting)):
            episode, by, at = self._waiting[0]
            try:
                self._journal.acknowledge(self._plant, episode, by, at)
            except JournalRefused as error:
                if self._outbox.pending:
                    return limits.FIRST_RETRY
                self._say(str(error))
            with self._changed:
                self._waiting.popleft()
        return limits.RENEWED

    def _read(self) -> None:
        known = self._journal.acknowledged(self._plant)
        if known != self._known:
            self._known = known
            self._seen(known)
