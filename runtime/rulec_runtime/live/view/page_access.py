"""Access to the page: not from other machines without the token, and not from foreign sites.

A page on loopback needs no token, but a web site that the operator visits could still request it.
Such requests name another host (DNS rebinding) or another origin, and are refused. Idle connections
make room for others.
"""

import asyncio
import hashlib
import hmac
import ipaddress
import re
import secrets
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import h11
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from rulec_runtime.live.network import is_loopback
from rulec_runtime.live.view import limits
from rulec_runtime.live.view.html import POLICY
from rulec_runtime.live.view.limits import SHORTEST_TOKEN
from rulec_runtime.output.refusal import Refusal

_HOST = re.compile(r"(?:\[([0-9a-f:.]+)\]|([^][:/@\s]+?)\.?)(?::\d+)?")


class PageRefused(Refusal):
    """The page would be open to everybody; the text says what to do."""


@dataclass(frozen=True)
class Gate:
    """`host` is where the page listens; forms contain `seal`, so that only pages of this process
    can send them."""

    host: str
    port: int
    token: str | None
    seal: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    def __post_init__(self) -> None:
        if self.token is not None and not self.token:
            raise PageRefused("the token of the page is empty")
        if is_loopback(self.host):
            return
        why = f"a page on {self.host} can be seen from other machines"
        if self.token is None:
            raise PageRefused(f"{why}: it needs a token")
        if len(self.token) < SHORTEST_TOKEN:
            raise PageRefused(f"{why}: its token needs at least {SHORTEST_TOKEN} characters")

    @property
    def cookie(self) -> str:
        """Name of the cookie, different for each port of a machine."""
        return f"rulec-{self.port}"

    @property
    def pass_(self) -> str:
        """Value of the cookie: not the token, but it can only be made with it."""
        return hmac.digest((self.token or "").encode(), b"rulec page", hashlib.sha256).hex()

    def knows_host(self, hosts: Iterable[str]) -> bool:
        """Whether a request names this machine: an address, which cannot be rebound, or a known
        name."""
        found = list(hosts)
        if len(found) != 1:
            return False
        name = name_of(found[0])
        try:
            ipaddress.ip_address(name)
        except ValueError:
            own = {"localhost", self.host}
            if not is_loopback(self.host):
                own |= {socket.gethostname(), socket.getfqdn()}
            return name != "" and name in {host.lower() for host in own}
        return True

    def lets_in(self, request: Request) -> bool:
        """Whether a request may see the plant; takes the same time for any wrong token."""
        if self.token is None:
            return True
        given = request.headers.getlist("authorization")
        if not given:
            return same(request.cookies.get(self.cookie, ""), self.pass_)
        kind, _, token = given[0].partition(" ")
        return len(given) == 1 and kind.lower() == "bearer" and same(token.strip(), self.token)

    def token_in(self, request: Request) -> bool:
        """Whether the address of the page contains the token."""
        if self.token is None or (request.method, request.scope["path"]) != ("GET", "/"):
            return False
        return any(same(text, self.token) for text in request.query_params.getlist("token"))

    def is_own_form(self, headers: Mapping[str, str], seal: str, bearer: bool) -> bool:
        """Whether a form comes from a page of ours, or from a program that has the token."""
        origin, site = headers.get("origin"), headers.get("sec-fetch-site")
        if origin is not None and origin.lower().partition("://")[2] != headers["host"].lower():
            return False
        if site not in (None, "same-origin"):
            return False
        return bearer or same(seal, self.seal)


def same(one: str, other: str) -> bool:
    """Compare secrets in constant time."""
    return hmac.compare_digest(one.encode("utf-8", "replace"), other.encode("utf-8", "replace"))


def name_of(host: str) -> str:
    """Name in a Host header, without port, brackets and the root dot; empty if it is invalid.

    >>> name_of("Plant.example:8080"), name_of("[::1]:80"), name_of("[::1].evil.example")
    ('plant.example', '::1', '')
    """
    found = _HOST.fullmatch(host.strip().lower())
    return (found[1] or found[2]) if found else ""


ALWAYS = [
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
]
"""A browser derives the origin of a form from the referrer: `no-referrer` would hide it."""


class Door:
    """Lets requests in that the gate accepts; refuses all others without revealing paths."""

    def __init__(self, inner: ASGIApp, gate: Gate) -> None:
        self._inner = inner
        self._gate = gate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle an ASGI request."""
        if scope["type"] != "http":
            return

        async def answered(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), *ALWAYS]}
            await send(message)

        await self._answer(Request(scope))(scope, receive, answered)

    def _answer(self, request: Request) -> ASGIApp:
        gate = self._gate
        if not gate.knows_host(request.headers.getlist("host")):
            text = "this page is not known by that name; use the machine's address\n"
            return PlainTextResponse(text, 421)
        if gate.token_in(request):
            # A redirect removes the token from the address.
            cookie = f"{gate.cookie}={gate.pass_}; HttpOnly; SameSite=Lax; Path=/"
            return Response(status_code=303, headers={"location": "./", "set-cookie": cookie})
        if gate.lets_in(request):
            return self._inner
        text = "a token is needed: open /?token=TOKEN, or send Authorization: Bearer TOKEN\n"
        return PlainTextResponse(text, 401, {"www-authenticate": "Bearer"})


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
