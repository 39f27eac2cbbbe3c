"""The gate before an ASGI application, and the headers of every response."""

from __future__ import annotations

from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from rulec_runtime.live.view.html import POLICY
from rulec_runtime.live.view.page_access import Gate

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

        found = [(n.decode("latin-1"), v.decode("latin-1")) for n, v in scope["headers"]]
        if not self._gate.knows_host(v for n, v in found if n == "host"):
            text = "this page is not known by that name; use the machine's address\n"
            answer: ASGIApp = PlainTextResponse(text, 421)
        elif self._token_in(scope):
            cookie = f"{self._gate.cookie}={self._gate.pass_}; HttpOnly; SameSite=Lax; Path=/"
            answer = Response(status_code=303, headers={"location": "./", "set-cookie": cookie})
        elif self._gate.lets_in(_bearer(found), _cookies(found, self._gate.cookie)):
            answer = self._inner
        else:
            text = "a token is needed: open /?token=TOKEN, or send Authorization: Bearer TOKEN\n"
            answer = PlainTextResponse(text, 401, {"www-authenticate": "Bearer"})
        await answer(scope, receive, answered)

    def _token_in(self, scope: Scope) -> bool:
        """Whether the address of the page contains the token; a redirect removes it."""
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
