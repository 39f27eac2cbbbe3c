"""Write the skeleton of a module type in YAML; what the package does not say is marked TODO."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rulec_runtime.output.terminal import one_line

from rulec.language.write_yaml import flow, rounded
from rulec.mtp import limits
from rulec.mtp.package import Package, Tag
from rulec.mtp.readings import Reading
from rulec.mtp.tables import tables


def skeleton(package: Package, name: str, readings: Sequence[Reading]) -> str:
    """Text of the file of a module type; it passes `rulec check` and has no observer yet."""
    lines = [
        *_head(package),
        f"module: {name}",
        "version: 1",
        f"title: {flow(_said(package.title or package.name) or name)}",
        *_signals([r for r in readings if not r.repeats]),
        *_repeated([r for r in readings if r.repeats]),
        *_todo(),
        *_others(package.tags),
        *_services(package.services),
        *_equipment(package),
        *_connections(package),
    ]
    return "\n".join(lines) + "\n"


def _head(package: Package) -> Iterator[str]:
    version = f", version {_said(package.version)}" if package.version else ""
    writer = f", written by {_said(package.writer)}" if package.writer else ""
    what = f"{_said(package.file)}: {_said(package.name)}"
    yield f"# From the Module Type Package {what}{version}{writer}."
    yield "# 'proposal' marks what was concluded from units, names and classes: confirm or"
    yield "# correct it, and delete the remark. 'TODO' marks what the package does not say."


def _signals(readings: Sequence[Reading]) -> Iterator[str]:
    if not readings:
        yield "# TODO no tag of the package is a measured number; declare what the module measures"
        return
    whole = any(not r.lacks for r in readings)
    yield "signals:" if whole else "# TODO signals; each lacks something:\n# signals:"
    for reading in readings:
        yield from (f"  # {line}" for line in _remarks(reading))
        entry = f"{reading.signal}: {flow(_entry(reading))}"
        if not reading.lacks:
            yield f"  {entry}  # proposal ({reading.proposal.confidence}): {_because(reading)}"
        else:
            yield f"  # TODO lacks {_said(reading.lacks)}"
            yield f"  # {entry}"


def _entry(reading: Reading) -> dict[str, object]:
    unit = reading.unit
    entry: dict[str, object] = {
        "quantity": reading.proposal.quantity or "TODO",
        "unit": unit.text or "TODO",
        "sensor": reading.sensor or "TODO",
    }
    if reading.range is not None:
        ends = (rounded(end, 9) for end in reading.range)
        entry["range"] = [int(x) if x.is_integer() and abs(x) < 1e15 else x for x in ends]
    if reading.is_input:
        entry["input"] = True
    return entry


def _because(reading: Reading) -> str:
    parts = [f"quantity by {reading.proposal.because}; sensor class by quantity"]
    whose = ["unit"] * reading.unit.is_default + ["range"] * reading.range_is_default
    if whose:
        parts.append(f"{' and '.join(whose)} by default, the controller may hold another")
    parts += ["set by the operator"] if reading.is_input else []
    return _said("; ".join(parts))


def _remarks(reading: Reading) -> Iterator[str]:
    tag = reading.tag
    title = f": {tag.title}" if tag.title and tag.title != tag.name else ""
    also = f" '{tag.given}'" if tag.given not in ("", tag.name) else ""
    yield _said(f"{tag.name}{also} ({tag.kind}.{reading.attribute}){title}")
    if reading.node is None:
        yield "no node: it cannot be read over OPC UA"
    if reading.limits:
        yield _said("limits: " + ", ".join(f"{n} {text}" for n, text in reading.limits.items()))
    if reading.proposal.against:
        yield _said(f"contradiction: {reading.proposal.against}")


def _repeated(readings: Sequence[Reading]) -> Iterator[str]:
    """Values of controllers, set points and parameters, which repeat what other tags measure."""
    if readings:
        yield ""
        yield "# Values of controllers, set points and parameters: they repeat what is measured or"
        yield "# asked for. Make one a signal where an equation needs it."
    for reading in readings[: limits.MOST_LISTED]:
        span = f", {reading.range[0]:g} to {reading.range[1]:g}" if reading.range else ""
        unit = reading.unit.text or "unit not said"
        name = f"{reading.tag.name} ({reading.tag.kind}.{reading.attribute})"
        yield f"#   {_said(f'{name}: {unit}{span}')}"


def _todo() -> Iterator[str]:
    yield ""
    yield "# TODO uncertainty: that of the sensor classes, unless a data sheet says another"
    yield "# TODO parameters: constants of the equations, each with value, unit, u and source"
    yield "# parameters:"
    yield '#   k2: {value: 1, unit: bar/(l/h)**2, u: 0.1, source: "data sheet"}'
    yield "# TODO observers: equations that estimate the flow Q from the signals above"
    yield "# observers:"
    yield '#   line: {component: line, Q: sqrt(SIGNAL/k2), source: "..."}'
    yield "# TODO faults: what can happen to it, each with what it acts on; kb/faults holds them"
    yield "# faults: []"


def _others(tags: Sequence[Tag]) -> Iterator[str]:
    for role, title in tables().listed.items():
        found = [t for t in tags if tables().classes.get(t.kind, "unknown") == role]
        if found:
            yield ""
            yield f"# {title}; equations read numbers alone."
        for tag in found[: limits.MOST_LISTED]:
            kind = tag.kind or tag.path.rpartition("/")[2] or "no class"
            title_of = f": {tag.title}" if tag.title else ""
            yield f"#   {_said(f'{tag.name} ({kind}){title_of}')}"


def _services(services: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    if services:
        yield ""
        yield "# Services:"
    for service in services[: limits.MOST_LISTED]:
        yield f"#   {_said(service['name'])}"
        for one in service["procedures"]:
            marks = ["default"] * one["default"] + ["ends by itself"] * one["completes"]
            more = f" ({', '.join(marks)})" if marks else ""
            asked = f": {_said(', '.join(one['parameters']))}" if one["parameters"] else ""
            name = _said(f"{one['number']} {one['name']}")
            yield f"#     procedure {name}{more}{asked}"
        asked_for = {name for one in service["procedures"] for name in one["parameters"]}
        names = (parameter["name"] for parameter in service["parameters"])
        if common := [name for name in names if name not in asked_for]:
            yield f"#     parameters: {_said(', '.join(common))}"


def _equipment(package: Package) -> Iterator[str]:
    found = [(symbol, kind) for symbol in package.symbols if (kind := equipment(symbol[1]))]
    if found:
        yield ""
        yield "# Equipment, proposal by ECLASS codes of the picture:"
    for (name, code), kind in found[: limits.MOST_LISTED]:
        yield f"#   {_said(f'{name}: {kind} ({code})')}"


def equipment(text: str) -> str:
    """The kind of equipment that a symbol shows by its ECLASS code; empty if unknown."""
    code = "".join(c for c in text if c.isdigit())
    kind = next((kind for begin, kind in tables().equipment.items() if code.startswith(begin)), "")
    return f"{kind}, of an unnamed kind" if kind and code.endswith("90") else kind


def _connections(package: Package) -> Iterator[str]:
    if package.connections:
        yield ""
        yield "# Pipes, proposal by the picture (which way it flows is not said):"
    for one in package.connections[: limits.MOST_LISTED]:
        how = "likely, linked in the file" if one["linked"] else "possible, by where they are drawn"
        yield f"#   {_said(' -- '.join(one['ends']))}  ({how})"


def _said(text: str) -> str:
    """A text of the package for a comment or a title: one line without control characters."""
    return one_line(" ".join(text.split()))[:200]


def source_map(modules: Mapping[str, tuple[Package, Sequence[Reading]]]) -> str:
    """Text of a map for all modules, by the names of their types."""
    servers = list(_servers(modules))
    signals = [line for name, (of, found) in modules.items() for line in _nodes(name, of, found)]
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


def _nodes(name: str, package: Package, readings: Sequence[Reading]) -> Iterator[str]:
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
