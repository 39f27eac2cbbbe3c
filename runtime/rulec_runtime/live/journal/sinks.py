"""Where a watch tells what it finds; each sink keeps or shows it in its own way."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.lines import LinesFile
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.now import Now
from rulec_runtime.output.write_file import write_data

if TYPE_CHECKING:
    from rulec_runtime.live.journal.device_health import DeviceHealth
    from rulec_runtime.live.journal.mqtt_out import MqttOut


class WatchSink(Protocol):
    """Somewhere that a watch tells what it finds."""

    def put(self, news: Sequence[Event], state: bytes, *, dated: bool) -> None:
        """Events of the rows that were judged last, and what is remembered after them.

        Raises `JournalRefused` or `JournalTrouble` where the watch must not go on without it.
        """

    def show(self, now: Now) -> None:
        """This is how the plant stands now; called several times a second, returns soon."""


class FileSink:
    """Lines of events, then the file of the state, on the disk before `put` returns."""

    def __init__(self, plant: str, lines: LinesFile | None, state: Path | None) -> None:
        self._plant, self._lines, self._state = plant, lines, state
        self._written = 0 if lines is None else lines.last(plant)

    def put(self, news: Sequence[Event], state: bytes, *, dated: bool) -> None:
        if self._lines is not None:
            new = [event for event in news if event.number > self._written]
            self._lines.commit(self._plant, new, None, dated=dated)
        if self._state is not None:
            # Behind the events: after a kill in between the next watch catches up with them.
            write_data(self._state, state)

    def ahead(self, number: int) -> list[Event]:
        """Events beyond the state, which ends with this number: it was killed between the two."""
        if self._lines is None or self._state is None:
            return []
        return self._lines.after(self._plant, number)

    def show(self, now: Now) -> None:
        pass


class JournalSink:
    """The journal: the watch does not go on where it takes nothing any more."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox

    def put(self, news: Sequence[Event], state: bytes, *, dated: bool) -> None:
        self._outbox.dated = dated
        self._outbox.put(news, state)

    def show(self, now: Now) -> None:
        pass


class MqttSink:
    """A broker: events by way of an outbox, the status when it changes and now and then.

    Whatever becomes of the broker, the watch goes on.
    """

    def __init__(self, broker: MqttOut, outbox: Outbox, say: Callable[[str], None]) -> None:
        self._broker, self._outbox, self._say = broker, outbox, say
        self._dated = self._deaf = False
        self._shown: tuple[object, ...] = ()
        self._due = 0.0

    def put(self, news: Sequence[Event], state: bytes, *, dated: bool) -> None:
        self._outbox.dated = self._dated = dated
        if not news:
            return
        try:
            self._outbox.put(news)
            self._deaf = False
        except (JournalRefused, JournalTrouble) as error:
            if not self._deaf:
                self._say(f"{error}; events for the broker are left out")
            self._deaf = True

    def show(self, now: Now) -> None:
        status = (now.status, len(now.active), now.connected, self._broker.sessions)
        clock = time.monotonic()
        if not _known(now) or (status == self._shown and clock < self._due):
            return
        try:
            self._broker.show(now.status, len(now.active), now.time, self._dated)
        except JournalTrouble:
            return  # the outbox tells of it; it is shown when the connection stands
        self._shown, self._due = status, clock + limits.RENEWED


class HealthSink:
    """An OPC UA server that says how each module is."""

    def __init__(self, server: DeviceHealth) -> None:
        self._server = server
        self._shown: tuple[object, ...] = ()

    def put(self, news: Sequence[Event], state: bytes, *, dated: bool) -> None:
        pass

    def show(self, now: Now) -> None:
        told = tuple((e.module, e.status, e.text) for e in now.active)
        if not _known(now) or (told, now.connected) == self._shown:
            return
        try:
            self._server.show(now.active, now.connected)
        except JournalTrouble:
            return  # tried again next time
        self._shown = (told, now.connected)


def _known(now: Now) -> bool:
    """Can anything be said? That nothing was judged yet is not that nothing was found."""
    return bool(now.active) or (now.diagnosis is not None and now.diagnosis.judged > 0)
