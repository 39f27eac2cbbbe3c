"""One OPC UA server of a map: connected again and again, each time with a new client."""

from __future__ import annotations

import asyncio
import contextlib
import random
import time as clocks
from collections.abc import Mapping, Sequence
from threading import Event

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import NoticeKind
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.abandon import bounded
from rulec_runtime.live.sources.assembler import Assembler
from rulec_runtime.live.sources.handover import Handover, now
from rulec_runtime.live.sources.map import Server, SourceMap
from rulec_runtime.live.sources.opcua_message import Message
from rulec_runtime.live.sources.refused import SourceRefused
from rulec_runtime.live.sources.remarks import Remarks, notice
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.recording_file import largest_reading


class Link:
    """Reads one server until it is cancelled.

    `answered` is set when the server was reached or failed for the first time; `refused` says why
    what it has is not what the map says, as far as that was its first answer.
    """

    def __init__(
        self,
        source: SourceMap,
        server: Server,
        ruleset: Ruleset,
        rows: Assembler,
        hand: Handover,
        remarks: Remarks,
    ) -> None:
        self._interval, self._server, self._ruleset = source.interval, server, ruleset
        self._rows, self._hand, self._remarks = rows, hand, remarks
        self._channels = [c for c in source.channels if c.server == server.name]
        self._largest = [largest_reading(c.signal) for c in self._channels]
        self._scales: Sequence[tuple[float, float]] = ()
        self._notes: Sequence[str] = ()
        self._heard = 0.0
        self._over, self._why = asyncio.Event(), ""
        self._bad: dict[str, str] = {}
        self._gone: float | None = None
        self._alive = False
        self.answered, self.refused = Event(), ""

    async def keep(self) -> None:
        """Read until the task is cancelled; what goes wrong is told, and tried again."""
        wait = limits.FIRST_RETRY
        while True:
            self._alive = False
            try:
                await self._session()
            except asyncio.CancelledError:
                raise
            except SourceRefused as error:
                if not self.answered.is_set():
                    self.refused = str(error)
                self._end("refused", str(error))
            except Exception as error:  # asyncua and cryptography raise errors of every kind
                self._end("lost", f"{self._server.endpoint}: {reason(error)}")
            self.answered.set()
            wait = limits.FIRST_RETRY if self._alive else min(2 * wait, limits.LAST_RETRY)
            await asyncio.sleep(wait * random.uniform(0.8, 1.2))

    async def _session(self) -> None:
        """One connection; ends with an error. The client is closed or abandoned in any case."""
        from rulec_runtime.live.sources.opcua_check import scales_of
        from rulec_runtime.live.sources.opcua_session import connected, discard, subscribed

        client = await connected(self._server)
        try:
            checked = scales_of(client, self._channels, self._ruleset)
            self._scales, self._notes = await bounded(checked, limits.CHECKING)
            self._heard, self._why = clocks.monotonic(), ""
            self._over = asyncio.Event()
            asked = subscribed(client, self._channels, self._interval, self._published)
            step = await bounded(asked, limits.CHECKING)
            self._tell_slower(step)
            self.answered.set()
            most = max(limits.SILENT, limits.SILENT_INTERVALS * step)
            await self._silent_for(most)
            raise ConnectionError(self._why or f"the server said nothing for {most:.3g} s")
        finally:
            await discard(client)

    async def _silent_for(self, most: float) -> None:
        """Returns when the server said nothing for `most` s, or that it is over."""
        while (left := most - (clocks.monotonic() - self._heard)) > 0:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._over.wait(), left)
                return

    def _published(self, message: Message) -> None:
        """A message of the server. Called by asyncua, which swallows what is raised."""
        if message.over:
            self._why = message.over
            self._over.set()
            return
        self._heard = clocks.monotonic()
        here = now()
        published = message.time if message.time is not None else here
        if abs(published - here) > limits.CLOCK_APART:
            text = f"{self._server.endpoint}: its clock is {published - here:+.0f} s from ours; "
            key = (self._server.name, "apart")
            told = self._remarks.tell("clock", key, now(), text + "rows bear our time")
            self._hand.notices(told)
            published = here
        values, stamps = self._values(message)
        if not values and not self._alive:
            return
        if not self._alive:
            self._alive = True
            self._tell_connected()
        late = max(limits.LATE_INTERVALS * self._interval, self._interval + 1.0)
        near = [t for t in stamps if abs(t - published) <= late]
        self._rows.put([self._server.name], values, max(near, default=published))

    def _values(self, message: Message) -> tuple[Mapping[str, float], list[float]]:
        """Readings in SI that changed, and their stamps."""
        from rulec_runtime.live.sources.opcua_session import number, seconds

        values, stamps = {}, []
        for index, value in message.values:
            if not 0 <= index < len(self._channels):
                continue
            signal = self._channels[index].signal.id
            factor, offset = self._scales[index]
            raw, bad = number(value)
            reading = raw * factor + offset
            if abs(reading) > self._largest[index]:
                reading, bad = float("nan"), "beyond any sensor"
            if bad and self._bad.get(signal) != bad:
                told = notice("refused", now(), f"{signal} has no reading: {bad}")
                self._hand.notices([told])
            self._bad[signal] = bad
            values[signal] = reading
            stamp = seconds(value.SourceTimestamp)
            if stamp is not None:
                stamps.append(stamp)
        return values, stamps

    def _tell_slower(self, step: float) -> None:
        if step > limits.LATE_INTERVALS * self._interval:
            text = f"{self._server.endpoint}: it publishes every {step:.3g} s only"
            self._hand.notices(
                self._remarks.tell("refused", (self._server.name, "slow"), now(), text)
            )

    def _tell_connected(self) -> None:
        """Told with the first values, before their row."""
        server = self._server
        safe = f"{server.access.policy}, {server.access.mode}" if server.access.policy else "open"
        signals = plural(len(self._channels), "signal", "signals")
        text = f"{server.endpoint} ({safe}): {signals} every {self._interval:g} s"
        if server.access.policy and server.access.server_certificate is None:
            text += "; no 'server_certificate' in the map, so any server is trusted"
        self._rows.found(server.name)
        still = self._rows.silent
        found = [notice("connected", now(), "; ".join([text, *self._notes]), still=still)]
        if self._gone is not None and self._rows.begun:
            quiet = now() - self._gone
            text = f"{server.endpoint}: nothing was read for {quiet:.3g} s"
            found.append(notice("gap", self._gone, text))
        self._gone = None
        self._hand.notices(found)

    def _end(self, kind: NoticeKind, text: str) -> None:
        """The connection is over; told once until it stands again."""
        self._rows.lost(self._server.name)
        if self._gone is None:
            self._gone = now()
            self._hand.notices([notice(kind, self._gone, text)])


def reason(error: Exception) -> str:
    """Why a connection failed, for people."""
    text = str(error).strip() or type(error).__name__
    return text if isinstance(error, OSError) else f"{type(error).__name__}: {text}"
