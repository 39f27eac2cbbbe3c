"""Access to a server: certificates, user, and secrets from outside the map."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

from rulec_runtime.live.network import is_loopback
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map_entry import Entry
from rulec_runtime.output.open_file import text_of

ACCESS = ("security", "user", "password")
"""Keys of a map for access."""

POLICIES = ("Basic256Sha256", "Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss")
MODES = ("SignAndEncrypt", "Sign")
ACCEPT = "accept"
ANSWERS = ("refuse", ACCEPT)
"""What to do with uncertain values and expired certificates."""
_SECURITY = ("policy", "mode", "certificate", "key", "server_certificate", "ca", "expired")


@dataclass(frozen=True, kw_only=True)
class Access:
    """Certificate files, user and password; `policy` is empty without certificates.

    `ca` holds the trusted authorities for a broker; `expired` whether expired certificates are
    accepted. The representation omits the password.
    """

    policy: str = ""
    mode: str = MODES[0]
    certificate: Path | None = None
    key: Path | None = None
    server_certificate: Path | None = None
    ca: Path | None = None
    expired: bool = False
    user: str = ""
    password: str = field(default="", repr=False)


def read_access(path: Path, entries: Mapping[str, Entry], endpoint: str) -> Access:
    """Read the access to a server; files are relative to the map. Raises `SourceRefused`."""
    own: Mapping[str, Entry] = {}
    if "security" in entries:
        own = entries["security"].items(_SECURITY)
    policy = _chosen(own, "policy", POLICIES) if own else ""
    files = {
        name: _file(path, own[name])
        for name in ("certificate", "key", "server_certificate", "ca")
        if name in own
    }
    parts = urlsplit(endpoint)
    if own and parts.scheme == "opc.tcp" and not {"certificate", "key"} <= files.keys():
        raise entries["security"].refused(
            "'security' needs 'certificate:' and 'key:', files of this computer's own certificate"
        )
    if "expired" in own and parts.scheme != "opc.tcp":
        raise own["expired"].refused("a broker whose certificate has expired is never read")
    password = _secret(path, entries["password"]) if "password" in entries else ""
    safe = parts.scheme == "mqtts" or bool(policy and parts.scheme == "opc.tcp")
    if password and not safe and not is_loopback(parts.hostname or ""):
        raise entries["password"].refused(
            "a password would travel readable; write 'security:', or mqtts:// for a broker"
        )
    return Access(
        policy=policy,
        mode=_chosen(own, "mode", MODES),
        expired=_chosen(own, "expired", ANSWERS) == ACCEPT,
        user=entries["user"].text() if "user" in entries else "",
        password=password,
        **files,
    )


def _chosen(own: Mapping[str, Entry], name: str, known: tuple[str, ...]) -> str:
    return own[name].one_of(known) if name in own else known[0]


def _file(path: Path, entry: Entry) -> Path:
    file = path.parent / entry.text()
    if not file.is_file():
        raise entry.refused(f"{file}: there is no such file")
    return file


def _secret(path: Path, entry: Entry) -> str:
    """A secret from the environment or a file; a secret in the map itself is refused."""
    remedy = "write 'password: {env: NAME}' or 'password: {file: PATH}'"
    if entry.is_text:
        raise entry.refused(f"a password does not stand in a map; {remedy}")
    own = entry.items(("env", "file"))
    if len(own) != 1:
        raise entry.refused(remedy)
    if "env" in own:
        name = own["env"].text()
        if not os.environ.get(name):
            raise own["env"].refused(f"the environment has no variable '{name[:60]}'")
        return os.environ[name]
    try:
        return text_of(_file(path, own["file"]), limits.LARGEST_MAP).strip()
    except (OSError, UnicodeDecodeError):
        raise own["file"].refused("the file of the password cannot be read") from None
