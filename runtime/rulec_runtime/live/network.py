"""What is loopback, and why a server was not trusted: the same for all that goes over a network."""

from __future__ import annotations

import ipaddress
import ssl


def is_loopback(host: str) -> bool:
    """Can only this machine reach it?"""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def tls_reason(error: ssl.SSLError) -> str:
    """Why no connection with TLS came about, for people."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is not trusted: {error.verify_message}"
    return f"TLS: {error.reason or error}"
