"""Sinks of a watch: each stores or shows events in its own way."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.moment import Now

if TYPE_CHECKING:
    from rulec_runtime.live.journal.device_health import DeviceHealth
    from rulec_runtime.live.journal.mqtt_out import MqttOut


class WatchSink(Protocol):
    """A destination of the results of a watch."""

    def put(self, events: Sequence[Event], state: bytes, *, dated: bool) -> None:
        """Take the events of the last rows, and the state after them.

        Raises `JournalRefused` or `JournalTrouble` if the watch must not continue without the sink.
        """

    def show(self, now: Now) -> None:
        """Show the present state of the plant; called several times a second, returns soon."""


class MqttSink:
    """A broker: events through an outbox, the status after each change and periodically.

    The watch continues whatever happens to the broker.
    """

    def __init__(self, broker: MqttOut, outbox: Outbox, say: Callable[[str], None]) -> None:
        self._broker, self._outbox, self._say = broker, outbox, say
        self._dated = self._deaf = False
        self._shown: tuple[object, ...] = ()
        self._due = 0.0

    def put(self, events: Sequence[Event], state: bytes, *, dated: bool) -> None:
        self._dated = dated
        if not events:
            return
        try:
            self._outbox.put(events, dated=dated)
            self._deaf = False
        except (JournalRefused, JournalTrouble) as error:
            if not self._deaf:
                self._say(f"{error}; events for the broker are left out")
            self._deaf = True

    def show(self, now: Now) -> None:
        status = (now.status, len(now.active), now.connected, self._broker.sessions)
        clock = time.monotonic()
        if not (now.active or now.judged) or (status == self._shown and clock < self._due):
            return
        try:
            self._broker.show(now.status, len(now.active), now.time, self._dated)
        except JournalTrouble:
            return  # the outbox reports it; the status is shown after the next connection
        self._shown, self._due = status, clock + limits.RENEWED


class HealthSink:
    """An OPC UA server for the health of each module."""

    def __init__(self, server: DeviceHealth) -> None:
        self._server = server
        self._shown: tuple[object, ...] = ()

    def put(self, events: Sequence[Event], state: bytes, *, dated: bool) -> None:
        pass

    def show(self, now: Now) -> None:
        shown = (now.connected, *((e.module, e.status, e.text) for e in now.active))
        if not (now.active or now.judged) or shown == self._shown:
            return
        try:
            self._server.show(now.active, now.connected)
        except JournalTrouble:
            return  # retried next time
        self._shown = shown
