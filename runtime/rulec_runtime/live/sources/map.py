"""The map of a source: the node or topic of each signal, and access to its server.

Each error names the file, the line and what to write instead. Secrets come from outside the map.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.live.network import is_loopback
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.remarks import SourceRefused, extra
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.output.open_file import begin_of, text_of
from rulec_runtime.recordings.reading_unit import conversion


class Entry:
    """A node of a map, with its place."""

    def __init__(self, path: Path, node: Any, name: str) -> None:
        self._path, self._node, self.name = path, node, name

    @property
    def place(self) -> str:
        return f"{self._path}, line {self._node.start_mark.line + 1}"

    def refused(self, text: str) -> SourceRefused:
        return SourceRefused(f"{self.place}: {text}")

    @property
    def is_text(self) -> bool:
        return bool(self._node.id == "scalar")

    def text(self) -> str:
        """A scalar that is not empty."""
        value = str(self._node.value).strip() if self.is_text else ""
        if not value:
            raise self.refused(f"'{self.name}' needs a single value")
        return value

    def one_of(self, choices: tuple[str, ...]) -> str:
        text = self.text()
        if text not in choices:
            raise self.refused(f"'{self.name}' is one of {', '.join(choices)}")
        return text

    def number(self, least: float = -float("inf")) -> float:
        try:
            value = float(self.text())
        except ValueError:
            value = float("nan")
        if not isfinite(value) or value < least:
            bound = f" of {least:g} or more" if isfinite(least) else ""
            raise self.refused(f"'{self.name}' needs a number{bound}")
        return value

    def items(self, keys: Iterable[str] | None = None) -> Mapping[str, Entry]:
        """Entries by key; raises `SourceRefused` for a key that is not one of `keys`."""
        if self._node.id != "mapping":
            raise self.refused(f"'{self.name}' needs entries such as 'key: value'")
        found: dict[str, Entry] = {}
        for key, value in self._node.value:
            name = str(key.value) if key.id == "scalar" else ""
            here = Entry(self._path, key, name)
            if not name or name in found:
                raise here.refused(f"'{name}' stands twice" if name else "a key must be a name")
            if keys is not None and name not in keys:
                raise here.refused(f"unknown key '{name[:40]}'; {did_you_mean(name, keys)}")
            found[name] = Entry(self._path, value, name)
        return found


def read_entries(path: Path, extra_of: str) -> Entry:
    """The root of a map. Raises `SourceRefused`."""
    yaml = extra("yaml", extra_of)
    try:
        data = begin_of(path, limits.LARGEST_MAP + 1)
    except OSError as error:
        raise SourceRefused(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > limits.LARGEST_MAP:
        raise SourceRefused(f"{path}: a map has less than {limits.LARGEST_MAP} bytes")
    if data.strip() and b"signals" not in data:  # never quote a foreign file
        raise SourceRefused(f"{path}: this is no map; it needs 'signals:'")
    try:
        node = yaml.compose(data.decode("utf-8-sig"), Loader=yaml.SafeLoader)
    except UnicodeDecodeError:
        raise SourceRefused(f"{path}: this is not UTF-8") from None
    except RecursionError:
        raise SourceRefused(f"{path}: it is nested too deep") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        why = getattr(error, "problem", None) or "it cannot be read"
        raise SourceRefused(f"{path}{where}: this is not YAML: {why}") from None
    if node is None:
        raise SourceRefused(f"{path}: the map is empty; it needs 'signals:'")
    return Entry(path, node, "map")


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
        name: _file_of(path, own[name])
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


def _chosen(own: Mapping[str, Entry], name: str, choices: tuple[str, ...]) -> str:
    return own[name].one_of(choices) if name in own else choices[0]


def _file_of(path: Path, entry: Entry) -> Path:
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
        return text_of(_file_of(path, own["file"]), limits.LARGEST_MAP).strip()
    except (OSError, UnicodeDecodeError):
        raise own["file"].refused("the file of the password cannot be read") from None


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of map: `address` is the key of a signal's node or topic."""

    extra: str
    address: str
    schemes: tuple[str, ...]
    example: str


OPCUA = Kind(extra="opcua", address="node", schemes=("opc.tcp",), example="opc.tcp://10.0.0.5:4840")
MQTT = Kind(
    extra="mqtt", address="topic", schemes=("mqtt", "mqtts"), example="mqtts://broker.plant:8883"
)


@dataclass(frozen=True, kw_only=True)
class Channel:
    """The origin of a signal: reading in `unit` = number * scale + offset.

    `unit` is empty if the map has none; `name` is the key in a topic's object. `index` is the index
    of the number in an array node, from 0; `uncertain` whether values of quality Uncertain count.
    `place` is the line of the map.
    """

    signal: SignalSpec
    address: str
    name: str
    unit: str
    scale: float
    offset: float
    server: str
    place: str
    index: int | None = None
    uncertain: bool = False

    def refused(self, text: str) -> SourceRefused:
        return SourceRefused(f"{self.place}: {self.signal.id} ({self.address}): {text}")


@dataclass(frozen=True, kw_only=True)
class Server:
    """A server or broker; `name` is empty for an unnamed one."""

    name: str
    endpoint: str
    access: Access


@dataclass(frozen=True, kw_only=True)
class SourceMap:
    """Channels and servers; `interval` from row to row and `stale` in s.

    For MQTT only: `time` is the key of the stamp, `client` our client id.
    """

    channels: tuple[Channel, ...]
    servers: tuple[Server, ...]
    interval: float
    stale: float
    time: str = ""
    client: str = ""


_KEYS = ("endpoint", "interval", "stale", "signals", "servers", *ACCESS)
_OF_SIGNAL = ("unit", "scale", "offset", "server")


def read_map(path: Path, kind: Kind, ruleset: Ruleset, endpoint: str = "") -> SourceMap:
    """Read a map; `endpoint` replaces the one in the map. Raises `SourceRefused`."""
    whole = read_entries(path, kind.extra)
    entries = whole.items((*_KEYS, *(("time", "client") if kind is MQTT else ())))
    servers = _servers(path, kind, entries, endpoint)
    if "signals" not in entries:
        raise whole.refused(f"the map needs 'signals:' with entries '<signal>: <{kind.address}>'")
    channels = []
    for name, entry in entries["signals"].items().items():
        if name not in ruleset.signal_by_id:
            known = [s.id for s in ruleset.signals if s.id in ruleset.read]
            hint = did_you_mean(name, known)
            raise entry.refused(f"'{name[:40]}' is no signal of the plant; {hint}")
        channels.append(_channel(kind, entry, ruleset, servers))
    if not ruleset.read.intersection(c.signal.id for c in channels):
        raise entries["signals"].refused("no signal of it stands in an equation of the plant")
    used = {c.server for c in channels}
    return SourceMap(
        channels=tuple(channels),
        servers=tuple(s for s in servers.values() if s.name in used),
        interval=_number(entries, "interval", limits.INTERVAL, limits.SHORTEST_INTERVAL),
        stale=_number(entries, "stale", limits.STALE, limits.SHORTEST_INTERVAL),
        time=entries["time"].text() if "time" in entries else "",
        client=entries["client"].text() if "client" in entries else "",
    )


def _number(entries: Mapping[str, Entry], name: str, default: float, least: float) -> float:
    return entries[name].number(least) if name in entries else default


def _servers(
    path: Path, kind: Kind, entries: Mapping[str, Entry], endpoint: str
) -> dict[str, Server]:
    """All servers by name; the source or the map itself states the unnamed one."""
    found: dict[str, Server] = {}
    if endpoint:
        found[""] = _server(path, kind, "", endpoint, "--source", entries)
    elif "endpoint" in entries:
        own = entries["endpoint"]
        found[""] = _server(path, kind, "", own.text(), own.place, entries)
    if "servers" not in entries:
        return found
    if kind is MQTT:
        raise entries["servers"].refused("several brokers need a map and a source each")
    for name, entry in entries["servers"].items().items():
        keys = entry.items(("endpoint", *ACCESS))
        if "endpoint" not in keys:
            raise entry.refused(f"server '{name}' needs 'endpoint: {kind.example}'")
        own = keys["endpoint"]
        found[name] = _server(path, kind, name, own.text(), own.place, {**entries, **keys})
    return found


def _server(
    path: Path, kind: Kind, name: str, text: str, place: str, keys: Mapping[str, Entry]
) -> Server:
    """The server of an endpoint that is given at `place`. Raises `SourceRefused`."""
    try:
        parts = urlsplit(text)
        whole = parts.scheme in kind.schemes and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:
        whole = False
    if not whole:
        example = f"write one such as {kind.example}"
        raise SourceRefused(f"{place}: '{text[:60]}' is no endpoint; {example}")
    if "@" in parts.netloc:
        remedy = "write 'user:' and 'password:' into the map"
        raise SourceRefused(f"{place}: an endpoint names no user; {remedy}")
    return Server(name=name, endpoint=text, access=read_access(path, keys, text))


def _channel(kind: Kind, entry: Entry, ruleset: Ruleset, servers: Mapping[str, Server]) -> Channel:
    signal = ruleset.signal_by_id[entry.name]
    more = ("name",) if kind is MQTT else ("index", "uncertain")
    own = {} if entry.is_text else entry.items((kind.address, *_OF_SIGNAL, *more))
    if not entry.is_text and kind.address not in own:
        raise entry.refused(f"{signal.id} needs '{kind.address}:'")
    address = (entry if entry.is_text else own[kind.address]).text()
    if kind is MQTT and (set("+#\0") & set(address)):
        raise entry.refused("a topic is written in full, without '+' and '#'")
    module = signal.id.partition(".")[0]
    name = own["server"].text() if "server" in own else (module if module in servers else "")
    if name not in servers:
        where = f"server '{name}' is not below 'servers:'" if name else "it has no server"
        raise entry.refused(f"{signal.id}: {where}; write 'endpoint: {kind.example}' into the map")
    unit = own["unit"].text() if "unit" in own else ""
    if unit:
        try:
            conversion(signal, unit, ruleset.units)
        except ValueError as error:
            raise own["unit"].refused(str(error)) from None
    return Channel(
        signal=signal,
        address=address,
        name=own["name"].text() if "name" in own else "",
        unit=unit,
        scale=own["scale"].number() if "scale" in own else 1.0,
        offset=own["offset"].number() if "offset" in own else 0.0,
        server=name,
        place=entry.place,
        index=int(own["index"].number(0.0)) if "index" in own else None,
        uncertain="uncertain" in own and own["uncertain"].one_of(ANSWERS) == ACCEPT,
    )
