"""Where a watch tells what it finds; each sink keeps or shows it in its own way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.now import Now
from rulec_runtime.live.steady import steady

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


class KeptSink:
    """What keeps events and state, by way of an outbox: the watch does not go on where that takes
    nothing any more.

    Events up to number `written` are there already. If it `waits`, they are on the disk before the
    next row is judged, unless they must wait.
    """

    def __init__(self, outbox: Outbox, written: int = 0, *, waits: bool = False) -> None:
        self._outbox, self._written, self._waits = outbox, written, waits

    def put(self, news: Sequence[Event], state: bytes, *, dated: bool) -> None:
        self._outbox.dated = dated
        self._outbox.put([event for event in news if event.number > self._written], state)
        if self._waits:
            self._outbox.settle()

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
        clock = steady()
        if not (now.active or now.judged) or (status == self._shown and clock < self._due):
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
        if not (now.active or now.judged) or (told, now.connected) == self._shown:
            return
        try:
            self._server.show(now.active, now.connected)
        except JournalTrouble:
            return  # tried again next time
        self._shown = (told, now.connected)
