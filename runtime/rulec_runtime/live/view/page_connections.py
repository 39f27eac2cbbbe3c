"""A connection to the page: idle connections make room for others."""

from __future__ import annotations

import asyncio
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from rulec_runtime.live.view import limits


class Visitor(H11Protocol):
    """A connection that must send each request in time.

    If there are too many connections of its address, or in all, the one that has owed a request for
    longest is closed. So slow or silent clients cannot shut others out.
    """

    _due: asyncio.TimerHandle | None = None
    """When it is closed, while it owes a request."""

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self._wait()
        crowd = [c for c in self.connections if isinstance(c, Visitor)]
        own = [c for c in crowd if c.client and self.client and c.client[0] == self.client[0]]
        if len(own) > limits.MOST_OF_AN_ADDRESS:
            crowd = own
        elif len(crowd) < limits.MOST_CONNECTIONS:
            return
        _, _, slowest = min((c._due.when(), id(c), c) for c in crowd if c._due is not None)
        slowest.connections.discard(slowest)  # no longer counted, even before it is closed
        slowest._end_wait()
        slowest.transport.abort()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._end_wait()

    def _wait(self) -> None:
        """Start or stop the timer, depending on whether it owes a request or the rest of one."""
        if self.conn.their_state not in (h11.IDLE, h11.SEND_BODY):
            self._end_wait()
        elif self._due is None:
            self._due = self.loop.call_later(limits.ASKING, self.transport.abort)

    def _end_wait(self) -> None:
        if self._due is not None:
            self._due.cancel()
            self._due = None
