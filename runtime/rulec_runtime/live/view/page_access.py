"""Access to the page: not from other machines without the token, and not from foreign sites.

A page on loopback needs no token, but a web site that the operator visits could still request it.
Such requests name another host (DNS rebinding) or another origin, and are refused.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import re
import secrets
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from rulec_runtime.live.network import is_loopback
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
            return name != "" and name in {known.lower() for known in own}
        return True

    def is_token(self, text: str) -> bool:
        """Whether a text is the token; takes the same time for any wrong text."""
        return self.token is not None and same(text, self.token)

    def lets_in(self, bearer: str | None, cookies: Iterable[str]) -> bool:
        """Whether a request may see the plant."""
        if self.token is None:
            return True
        if bearer is not None:
            return self.is_token(bearer)
        return any(same(cookie, self.pass_) for cookie in cookies)

    def is_own_form(self, headers: Mapping[str, str], seal: str, bearer: bool) -> bool:
        """Whether a form comes from a page of ours, or from a program that has the token."""
        origin, site = headers.get("origin"), headers.get("sec-fetch-site")
        if origin is not None and _netloc(origin) != headers["host"].lower():
            return False
        if site not in (None, "same-origin"):
            return False
        return bearer or same(seal, self.seal)


def same(one: str, other: str) -> bool:
    """Compare secrets in constant time."""
    return hmac.compare_digest(one.encode("utf-8", "replace"), other.encode("utf-8", "replace"))


def _netloc(origin: str) -> str:
    """Host and port of an origin; empty if it is invalid."""
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def name_of(host: str) -> str:
    """Name in a Host header, without port, brackets and the root dot; empty if it is invalid.

    >>> name_of("Plant.example:8080"), name_of("[::1]:80"), name_of("[::1].evil.example")
    ('plant.example', '::1', '')
    """
    found = _HOST.fullmatch(host.strip().lower())
    return (found[1] or found[2]) if found else ""
