"""The gate before an ASGI application, and what every answer says to the browser."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

from rulec_runtime.live.view.gate import Gate
from rulec_runtime.live.view.html import POLICY

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Inner = Callable[[Message, Receive, Send], Awaitable[None]]
Headers = list[tuple[bytes, bytes]]

ALWAYS: Headers = [
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
]
"""Of the referrer a browser also makes the origin of a form: `no-referrer` would hide it."""


class Door:
    """Lets requests in that the gate knows; all others get a refusal and see no path."""

    def __init__(self, inner: Inner, gate: Gate) -> None:
        self._inner = inner
        self._gate = gate

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Of ASGI."""
        if scope["type"] != "http":
            return

        async def answered(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), *ALWAYS]}
            await send(message)

        found = [(n.decode("latin-1"), v.decode("latin-1")) for n, v in scope["headers"]]
        if not self._gate.knows_host(v for n, v in found if n == "host"):
            text = "this page is not known by that name; use the machine's address\n"
            await _refuse(answered, 421, text)
        elif self._token_in(scope):
            cookie = f"{self._gate.cookie}={self._gate.pass_}; HttpOnly; SameSite=Lax; Path=/"
            extra = [(b"location", b"./"), (b"set-cookie", cookie.encode())]
            await _refuse(answered, 303, "", extra)
        elif self._gate.lets_in(_bearer(found), _cookies(found, self._gate.cookie)):
            await self._inner(scope, receive, answered)
        else:
            text = "a token is needed: open /?token=TOKEN, or send Authorization: Bearer TOKEN\n"
            await _refuse(answered, 401, text, [(b"www-authenticate", b"Bearer")])

    def _token_in(self, scope: Message) -> bool:
        """Is the token in the address of the page? It does not stay there."""
        if scope["method"] != "GET" or scope["path"] != "/":
            return False
        try:
            asked = parse_qs(scope["query_string"].decode("latin-1"), max_num_fields=8)
        except ValueError:
            return False
        return any(self._gate.is_token(text) for text in asked.get("token", ()))


def _bearer(headers: list[tuple[str, str]]) -> str | None:
    given = [v for n, v in headers if n == "authorization"]
    if not given:
        return None
    kind, _, token = given[0].partition(" ")
    return token.strip() if kind.lower() == "bearer" and len(given) == 1 else ""


def _cookies(headers: list[tuple[str, str]], name: str) -> list[str]:
    found = []
    for text in (v for n, v in headers if n == "cookie"):
        try:
            cookie = SimpleCookie(text).get(name)
        except CookieError:
            continue
        if cookie is not None:
            found.append(cookie.value)
    return found


async def _refuse(send: Send, status: int, text: str, extra: Headers | None = None) -> None:
    headers = [(b"content-type", b"text/plain; charset=utf-8"), *(extra or [])]
    body = text.encode()
    headers.append((b"content-length", str(len(body)).encode()))
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
