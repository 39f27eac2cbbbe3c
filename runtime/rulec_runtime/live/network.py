"""Loopback addresses and TLS errors, for all network connections."""

import ipaddress
import ssl


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach the host."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def tls_reason(error: ssl.SSLError) -> str:
    """Why a TLS connection failed, for people."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is not trusted: {error.verify_message}"
    return f"TLS: {error.reason or error}"
