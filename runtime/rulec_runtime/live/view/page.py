"""Serves the page, what changes on it, JSON and metrics; accepts only acknowledgements.

Needs the extra `page`.
"""

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable
from dataclasses import replace
from urllib.parse import parse_qs

import uvicorn
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from rulec_runtime.live.moment import Now
from rulec_runtime.live.view import limits
from rulec_runtime.live.view.html import key_of, link_of, main_of, page_of, title_of
from rulec_runtime.live.view.machine_forms import TYPE, metrics, now_text
from rulec_runtime.live.view.page_access import Door, Gate, Visitor

Acknowledge = Callable[[str, str], None]


class Page:
    """A page that is served in its own thread until it is closed."""

    def __init__(self, server: uvicorn.Server, bound: socket.socket, url: str) -> None:
        self.url = url
        self._server, self._bound = server, bound
        self._thread = threading.Thread(target=self._serve, name="page", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close all connections; returns when the port is free."""
        self._server.should_exit = True
        self._thread.join()
        self._bound.close()

    def _serve(self) -> None:
        asyncio.run(self._server.serve(sockets=[self._bound]))


def serve(
    state_of: Callable[[], Now], host: str, port: int, token: str | None, acknowledge: Acknowledge
) -> Page:
    """Serve the page until it is closed.

    Parameters
    ----------
    state_of : returns the present moment at once; called from threads of the server.
    port : 0 takes any free one; see `Page.url`.
    token : required if `host` is not loopback; every request must then contain it.
    acknowledge : takes the id of an episode and who acknowledges; called from a server thread.

    Raises `PageRefused` if the page would be open to everybody, OSError if the port is not
    available.
    """
    gate = Gate(host, port, token)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.create_server((host, port), family=family)
    port = bound.getsockname()[1]
    gate = replace(gate, port=port)
    config = uvicorn.Config(
        application(state_of, gate, acknowledge),
        log_config=None,
        log_level="critical",
        access_log=False,
        lifespan="off",
        ws="none",
        loop="asyncio",
        http=Visitor,
        server_header=False,
        proxy_headers=False,
        limit_concurrency=limits.MOST_CONNECTIONS,
        timeout_graceful_shutdown=1,
    )
    shown = f"[{host}]" if ":" in host else host
    return Page(uvicorn.Server(config), bound, f"http://{shown}:{port}/")


def application(state_of: Callable[[], Now], gate: Gate, acknowledge: Acknowledge) -> Door:
    """All paths behind the gate."""

    async def page(_: Request) -> Response:
        now = state_of()
        return HTMLResponse(page_of(now, now.age, main_of(now, gate.seal)))

    async def changed(_: Request) -> Response:
        now = state_of()
        parts = {"title": title_of(now), "link": link_of(now, now.age)}
        return JSONResponse({**parts, "main": main_of(now, gate.seal)})

    async def data(_: Request) -> Response:
        now = state_of()
        return Response(now_text(now, now.age), media_type="application/json")

    async def measured(_: Request) -> Response:
        now = state_of()
        return Response(metrics(now, now.age), headers={"content-type": TYPE})

    async def noted(request: Request) -> Response:
        form = await _form(request)
        if form is None:
            return PlainTextResponse("this is no form of the page\n", 413)
        bearer = "authorization" in request.headers and gate.token is not None
        if not gate.is_own_form(request.headers, form.get("seal", ""), bearer):
            return PlainTextResponse("this form was not sent by the page\n", 403)
        asked = form.get("episode", "")
        episode = next((e.id for e in state_of().active if asked in (e.id, key_of(e.id))), None)
        if episode is None:
            return PlainTextResponse("there is no such episode any more\n", 404)
        client = request.client.host if request.client else ""
        name = form.get("by", "").strip()
        who = ", ".join(filter(None, (name, f"page {client}".strip())))
        await asyncio.to_thread(acknowledge, episode, who)
        if request.headers.get("accept") == "application/json":
            return Response(status_code=204)
        return Response(status_code=303, headers={"location": "./"})

    routes = [
        Route("/", page),
        Route("/now", changed),
        Route("/now.json", data),
        Route("/metrics", measured),
        Route("/acknowledge", noted, methods=["POST"]),
    ]
    return Door(Starlette(routes=routes), gate)


async def _form(request: Request) -> dict[str, str] | None:
    """Fields of a form; None if it is too long or invalid."""
    body = b""
    with contextlib.suppress(ClientDisconnect):
        async for part in request.stream():
            body += part
            if len(body) > limits.LONGEST_FORM:
                return None
    try:
        fields = parse_qs(body.decode("utf-8", "replace"), max_num_fields=8)
    except ValueError:
        return None
    return {name: values[-1] for name, values in fields.items()}
