"""The map of a source: the node or topic of each signal, and access to its server."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map_access import ACCEPT, ACCESS, ANSWERS, Access, read_access
from rulec_runtime.live.sources.map_entry import Entry, read_entries
from rulec_runtime.live.sources.refused import SourceRefused
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.recordings.reading_unit import fitting, parse_unit


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
            conversion(signal, unit, ruleset)
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


def conversion(signal: SignalSpec, unit: str, ruleset: Ruleset) -> tuple[float, float]:
    """Factor and offset: SI = reading in `unit` * factor + offset. Raises ValueError.

    Without a unit, that of the signal is used.
    """
    if not unit or unit == signal.unit:
        return signal.factor, signal.offset
    found = parse_unit(unit, ruleset.units)
    wanted = parse_unit(signal.unit, ruleset.units)
    known = ", ".join((fitting(wanted, ruleset.units) or [signal.unit])[:8])
    if found is None:
        raise ValueError(f"unknown unit '{unit[:40]}'; for {signal.id} write {known}")
    if wanted is not None and found.dimension != wanted.dimension:
        raise ValueError(
            f"{signal.id} is measured in {signal.unit}, but this is in {unit[:40]}; "
            "is it another signal?"
        )
    return found.factor, found.offset
