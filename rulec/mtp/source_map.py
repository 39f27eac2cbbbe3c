"""Write the map for `rulec watch`: which signal is which node of which server."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rulec.language.yaml_text import flow
from rulec.mtp import limits
from rulec.mtp.package import Package
from rulec.mtp.readings import Reading


def source_map(modules: Mapping[str, tuple[Package, Sequence[Reading]]]) -> str:
    """Text of a map for all modules, by the names of their types."""
    servers = list(_servers(modules))
    signals = [line for name, (of, found) in modules.items() for line in _signals(name, of, found)]
    lines = [
        "# Which signal is which node, for: rulec watch PLANT --source opcua --map THIS_FILE",
        "# Modules bear the names of their types; give them the names of your plant.yaml. A",
        "# line in a comment belongs to a signal that lacks something in its module type.",
        "interval: 1",
        _key("servers", servers),
        *servers,
        _key("signals", signals),
        *signals,
    ]
    return "\n".join(lines) + "\n"


def _key(name: str, entries: Sequence[str]) -> str:
    """A key; a comment if all its entries are comments."""
    return f"{name}:" if any(not e.lstrip().startswith("#") for e in entries) else f"# {name}:"


def _servers(modules: Mapping[str, tuple[Package, Sequence[Reading]]]) -> Iterator[str]:
    for name, (package, _) in modules.items():
        module = instance_name(name)
        for number, server in enumerate(package.servers):
            own = _server_name(module, number)
            if server.endpoint:
                yield f"  {own}: {flow({'endpoint': server.endpoint})}"
            else:
                entry = flow({"endpoint": "opc.tcp://TODO:4840"})
                yield f"  # {own}: {entry}  # the package names no endpoint"


def _server_name(module: str, number: int) -> str:
    """The first server of a module takes its name, so that signals need not name the server."""
    return module if number == 0 else f"{module}_{number + 1}"


def instance_name(module: str) -> str:
    """The name of a module in a plant, which holds no dashes, from that of its type."""
    return module.replace("-", "_")[: limits.LONGEST_SIGNAL]


def _signals(name: str, package: Package, readings: Sequence[Reading]) -> Iterator[str]:
    module = instance_name(name)
    numbers = {server.name: i for i, server in enumerate(package.servers)}
    for reading in readings:
        if reading.repeats or reading.node is None:
            continue
        entry: dict[str, object] = {"node": reading.node.id}
        if reading.unit.unit is not None:
            entry["unit"] = reading.unit.text
        if number := numbers.get(reading.node.server, 0):
            entry["server"] = _server_name(module, number)
        access = f"  # {reading.node.access}" if reading.node.access else ""
        yield f"  {'# ' * bool(reading.lacks)}{module}.{reading.signal}: {flow(entry)}{access}"
