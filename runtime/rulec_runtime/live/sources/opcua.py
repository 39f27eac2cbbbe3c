"""OPC UA: read-only subscriptions to the servers of a map, in a separate thread."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from threading import Thread
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.assembler import Assembler
from rulec_runtime.live.sources.map import SourceMap
from rulec_runtime.live.sources.opcua_link import Link
from rulec_runtime.live.sources.refused import SourceRefused
from rulec_runtime.live.sources.remarks import Remarks
from rulec_runtime.live.sources.row_queue import Handover
from rulec_runtime.live.steady_clock import Standstill, steady, steady_loop


class OpcUa:
    """Rows of one or more servers: a row per publishing interval, values held between changes.

    The time of a row is the newest stamp of the values changed since the last row, or the time at
    which the server reported no change. Waits at the start for the first answer of the servers;
    raises `SourceRefused` if a node does not match the map. `resume` is the `position` of an
    earlier process.
    """

    dated = True

    def __init__(
        self, source: SourceMap, ruleset: Ruleset, resume: Mapping[str, Any] | None
    ) -> None:
        logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)  # it logs what servers send
        place_of = {c.signal.id: c.server for c in source.channels}
        self._source, self._remarks = source, Remarks()
        self._hand = Handover(tuple(place_of))
        self._rows = Assembler(source, place_of, self._hand, self._remarks)
        self._still = Standstill()
        known = (resume or {}).get("namespaces", {})
        shared = (self._rows, self._hand, self._remarks, self._still)
        self._links = {
            s.name: Link(source, s, ruleset, *shared, known.get(s.name, {})) for s in source.servers
        }
        self.ended = False
        self._loop = steady_loop()
        self._thread = Thread(target=self._run, name="opcua", daemon=True)
        self._thread.start()
        until = steady() + limits.OPENING
        for link in self._links.values():
            link.answered.wait(max(0.0, until - steady()))
        refused = [link.refused for link in self._links.values() if link.refused]
        if refused:
            self.close()
            raise SourceRefused(refused[0])

    @property
    def position(self) -> dict[str, Any]:
        """The URIs of the namespace numbers in the map, by server; can be stored as JSON."""
        return {"namespaces": {name: dict(one.namespaces) for name, one in self._links.items()}}

    def take(self, seconds: float) -> list[Rows | Notice]:
        return [] if self.ended else self._hand.take(seconds)

    def close(self) -> None:
        """Close the sessions; those that do not close in time are abandoned."""
        self.ended = True
        self._loop.call_soon_threadsafe(self._stop)
        self._thread.join(limits.CLOSING + 1)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._tasks = [self._loop.create_task(link.keep()) for link in self._links.values()]
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
            if lasted := self._still.lasted:
                for link in self._links.values():
                    link.begin_anew(lasted)
            self._still.moves()
            self._rows.tick()
