"""OPC UA: read-only subscriptions to the servers of a map, in a separate thread.

A server is reconnected after each failure with a new client.
"""

import asyncio
import contextlib
import logging
import random
import time as clocks
from collections.abc import Mapping, Sequence
from threading import Event, Thread
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, NoticeKind, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.assembler import Assembler, Handover, usable
from rulec_runtime.live.sources.map import Server, SourceMap
from rulec_runtime.live.sources.opcua_nodes import gone_of, nodes_of, scales_of
from rulec_runtime.live.sources.opcua_session import (
    Message,
    bounded,
    connected,
    discard,
    is_gone,
    monitored,
    number,
    seconds,
    subscribed,
)
from rulec_runtime.live.sources.remarks import Remarks, SourceRefused, notice
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.recording_file import largest_reading


class Link:
    """Reads one server until it is cancelled.

    `answered` is set when the server was reached or has failed for the first time; `refused` says
    why it does not match the map, if that was its first answer.
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
        self._interval, self._stale = source.interval, source.stale
        self._server, self._ruleset = server, ruleset
        self._rows, self._hand, self._remarks = rows, hand, remarks
        self._channels = [c for c in source.channels if c.server == server.name]
        self._largest = [largest_reading(c.signal) for c in self._channels]
        self._scales: dict[int, tuple[float, float]] = {}
        self._notes: Sequence[str] = ()
        self._lacking: set[int] = set()
        self._heard = 0.0
        self._over, self._why = asyncio.Event(), ""
        self._gone: float | None = None
        self._reported = ""
        self._alive = False
        self.answered, self.refused = Event(), ""

    async def keep(self) -> None:
        """Read until the task is cancelled; failures are reported and retried."""
        wait = limits.FIRST_RETRY
        while True:
            self._alive = False
            try:
                await self._session()
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
        """One connection; always ends with an error, and closes or abandons the client."""
        client = await connected(self._server)
        try:
            self._scales, self._lacking = {}, set(range(len(self._channels)))
            self._heard, self._why = clocks.monotonic(), ""
            self._over = asyncio.Event()
            asked = subscribed(client, self._interval, self._published)
            subscription, step = await bounded(asked, limits.CHECKING)
            await bounded(self._subscribe(client, subscription), limits.CHECKING)
            if step > limits.LATE_INTERVALS * self._interval:
                text = f"{self._server.endpoint}: it publishes every {step:.3g} s only"
                self._tell("refused", "slow", text)
            self.answered.set()
            most = max(limits.SILENT, limits.SILENT_INTERVALS * step)
            while await self._heard_for(self._stale, most):
                await bounded(self._subscribe(client, subscription), limits.CHECKING)
            raise ConnectionError(self._why or f"the server said nothing for {most:.3g} s")
        finally:
            await discard(client)

    async def _subscribe(self, client: Any, subscription: int) -> None:
        """Subscribe to the missing nodes that match the map.

        Raises `SourceRefused` for others in the first answer; later their signals have no reading.
        Not every server reports that a node is gone, so all nodes are checked.
        """
        every = await nodes_of(client, self._channels)
        self._lacking |= await gone_of(client, every)
        asked = sorted(self._lacking)
        if not asked:
            return
        channels, nodes = [self._channels[i] for i in asked], [every[i] for i in asked]
        scales, self._notes = await scales_of(client, channels, nodes, self._ruleset)
        good = {}
        for i, node, scale in zip(asked, nodes, scales, strict=True):
            if not isinstance(scale, str):
                self._scales[i], good[i] = scale, node
                self._lacking.discard(i)
        failed = await monitored(client, subscription, good, self._interval)
        failed |= {i: s for i, s in zip(asked, scales, strict=True) if isinstance(s, str)}
        for i, why in failed.items():
            if not self.answered.is_set():
                raise self._channels[i].refused(why)
            self._lacking.add(i)
            self._rows.take(self._channels[i].signal.id, float("nan"), why)

    async def _heard_for(self, seconds: float, most: float) -> bool:
        """Returns after so many s; False if the server was silent for `most` s, or has ended the
        subscription."""
        until = clocks.monotonic() + seconds
        while (left := min(until, self._heard + most) - clocks.monotonic()) > 0:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._over.wait(), left)
                return False
        return clocks.monotonic() < self._heard + most

    def _published(self, message: Message) -> None:
        """Takes a message of the server. asyncua calls it and swallows exceptions."""
        if message.over:
            self._why = message.over
            self._over.set()
            return
        self._heard = clocks.monotonic()
        here = clocks.time()
        published = message.time if message.time is not None else here
        if abs(published - here) > limits.CLOCK_APART:
            text = f"{self._server.endpoint}: its clock is {published - here:+.0f} s from ours; "
            self._tell("clock", "apart", text + "rows bear our time")
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

    def _values(self, message: Message) -> tuple[Mapping[str, tuple[float, str]], list[float]]:
        """Changed readings in SI, or why there are none, and their stamps."""
        values, stamps = {}, []
        for index, value in message.values:
            if index not in self._scales:
                continue
            factor, offset = self._scales[index]
            raw, why = number(value, self._channels[index])
            reading = usable(raw * factor + offset, why, self._largest[index])
            values[self._channels[index].signal.id] = reading
            if is_gone(value):
                self._lacking.add(index)
            stamp = seconds(value.SourceTimestamp)
            if stamp is not None:
                stamps.append(stamp)
        return values, stamps

    def _tell(self, kind: NoticeKind, key: str, text: str) -> None:
        notices = self._remarks.tell(kind, (self._server.name, key), clocks.time(), text)
        self._hand.notices(notices)

    def _tell_connected(self) -> None:
        """Reported with the first values, before their row."""
        server = self._server
        safe = f"{server.access.policy}, {server.access.mode}" if server.access.policy else "open"
        signals = plural(len(self._scales), "signal", "signals")
        text = f"{server.endpoint} ({safe}): {signals} every {self._interval:g} s"
        if server.access.policy and server.access.server_certificate is None:
            text += "; no 'server_certificate' in the map, so any server is trusted"
        self._rows.found(server.name)
        still = self._rows.silent
        found = [notice("connected", clocks.time(), "; ".join([text, *self._notes]), still=still)]
        if self._gone is not None and self._rows.begun:
            quiet = clocks.time() - self._gone
            text = f"{server.endpoint}: nothing was read for {quiet:.3g} s"
            found.append(notice("gap", self._gone, text))
        self._gone = None
        self._hand.notices(found)

    def _end(self, kind: NoticeKind, text: str) -> None:
        """The connection has ended, which is reported once per loss."""
        self._rows.lost(self._server.name)
        if self._gone is None or (kind == "refused" and text != self._reported):
            self._gone, self._reported = self._gone or clocks.time(), text
            self._hand.notices([notice(kind, clocks.time(), text)])


def reason(error: Exception) -> str:
    """Why a connection failed, for people."""
    text = str(error).strip() or type(error).__name__
    return text if isinstance(error, OSError) else f"{type(error).__name__}: {text}"


class OpcUa:
    """Rows of one or more servers: a row per publishing interval, values held between changes.

    The time of a row is the newest stamp of the values changed since the last row, or the time at
    which the server reported no change. Waits at the start for the first answer of the servers;
    raises `SourceRefused` if a node does not match the map.
    """

    dated = True

    def __init__(self, source: SourceMap, ruleset: Ruleset) -> None:
        logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)  # it logs what servers send
        sender_of = {c.signal.id: c.server for c in source.channels}
        self._source, self._remarks = source, Remarks()
        self._hand = Handover()
        self._rows = Assembler(source, sender_of, self._hand, self._remarks)
        shared = (self._rows, self._hand, self._remarks)
        self._links = [Link(source, server, ruleset, *shared) for server in source.servers]
        self.ended = False
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._run, name="opcua", daemon=True)
        self._thread.start()
        until = clocks.monotonic() + limits.OPENING
        for link in self._links:
            link.answered.wait(max(0.0, until - clocks.monotonic()))
        refused = [link.refused for link in self._links if link.refused]
        if refused:
            self.close()
            raise SourceRefused(refused[0])

    def take(self, seconds: float) -> list[Rows | Notice]:
        return [] if self.ended else self._hand.take(seconds)

    def close(self) -> None:
        """Close the sessions; those that do not close in time are abandoned."""
        self.ended = True
        self._loop.call_soon_threadsafe(self._stop)
        self._thread.join(limits.CLOSING + 1)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._tasks = [self._loop.create_task(link.keep()) for link in self._links]
        self._tasks.append(self._loop.create_task(self._ticks()))
        self._loop.run_forever()

    def _stop(self) -> None:
        async def end() -> None:
            for task in self._tasks:
                task.cancel()
            await asyncio.wait(self._tasks, timeout=limits.CLOSING)
            self._loop.stop()

        self._ending = self._loop.create_task(end())

    async def _ticks(self) -> None:
        while True:
            await asyncio.sleep(min(self._source.interval / 4, limits.TICK))
            self._rows.tick()
