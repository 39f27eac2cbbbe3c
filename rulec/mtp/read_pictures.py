"""Read from pictures which symbols a pipe joins; a file says so nowhere else.

Makers write this in three ways: links between ids of nozzles, links between ids of their
connectors, and pipes that merely end where a symbol is drawn.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from rulec.mtp import limits
from rulec.mtp.caex import Element
from rulec.mtp.package import Connection, Symbol
from rulec.mtp.space import Space


@dataclass(frozen=True)
class _Box:
    x: float
    y: float
    width: float
    height: float

    def distance(self, x: float, y: float) -> float:
        """From its edge outwards; 0 inside."""
        dx = max(self.x - x, 0.0, x - self.x - self.width)
        dy = max(self.y - y, 0.0, y - self.y - self.height)
        return float((dx * dx + dy * dy) ** 0.5)

    def is_near(self, x: float, y: float) -> bool:
        return self.distance(x, y) <= limits.NEAR_SYMBOL * min(self.width, self.height)


def read_pictures(
    space: Space, parts: Sequence[Element]
) -> tuple[tuple[Symbol, ...], tuple[Connection, ...]]:
    """Symbols, and the pairs that a pipe joins."""
    symbols: list[Symbol] = []
    connections: list[Connection] = []
    for part in parts:
        for picture in part.inside():
            if space.is_a(picture, "Picture"):
                shown, joined = _picture(space, picture)
                symbols += shown
                connections += joined
    return tuple(symbols), tuple(connections)


def _picture(space: Space, picture: Element) -> tuple[list[Symbol], list[Connection]]:
    inside = (e for e in picture.inside() if e is not picture)
    things = [e for e in inside if not space.passes(e, "PortObject")]
    pipes = [e for e in things if space.is_a(e, "Pipe")]
    drawn = {id(e): e for e in things if not space.passes(e, "Connection")}
    named = _names(space, drawn)
    owners = {**{id(e): e for e in pipes}, **drawn}
    links: dict[int, list[tuple[int, Element]]] = {}
    for one, other in _links(space, picture, owners):
        for here, there in ((one, other), (other, one)):
            links.setdefault(id(here[0]), []).append((id(there[0]), here[1]))
    boxes = {named[k]: box for k, e in drawn.items() if (box := _box(e)) is not None}
    if max(len(boxes), len(pipes)) > limits.MOST_DRAWN:
        boxes = {}
    found = [
        connection
        for pipe in pipes
        for connection in _joined(space, pipe, boxes, named, links.get(id(pipe), []))
    ]
    return [_symbol(e, named[id(e)]) for e in drawn.values()], found


def _names(space: Space, drawn: Mapping[int, Element]) -> dict[int, str]:
    """Names of symbols, numbered where several share one."""
    counts: dict[str, int] = {}
    found = {}
    for key, element in drawn.items():
        name = space.name(element) or "symbol"
        counts[name] = counts.get(name, 0) + 1
        found[key] = name if counts[name] == 1 else f"{name} ({counts[name]})"
    return found


def _symbol(element: Element, name: str) -> Symbol:
    texts = element.values()
    code = texts.get("eclassclassificationclass", "").strip()
    return Symbol(name=name, code=code, tag=texts.get("refid", "").lower())


def _links(
    space: Space, picture: Element, owners: Mapping[int, Element]
) -> Iterator[tuple[tuple[Element, Element], tuple[Element, Element]]]:
    """Pairs of linked symbols or pipes, each with its linked port."""
    for element in picture.walk():
        if element.tag != "InternalLink":
            continue
        partners = [element.get(f"RefPartnerSide{side}") for side in ("A", "B")]
        ends = [_owner(space, element, partner, owners) for partner in partners]
        if ends[0] is not None and ends[1] is not None and ends[0][0] is not ends[1][0]:
            yield ends[0], ends[1]


def _owner(
    space: Space, link: Element, partner: str, owners: Mapping[int, Element]
) -> tuple[Element, Element] | None:
    """Owner and port of the end of a link: `id`, `id:connector` or `id/connector`."""
    for text in (partner, partner.rpartition(":")[0], partner.rpartition("/")[0]):
        port = space.find(text, link) if text else None
        here = port
        while here is not None:
            if id(here) in owners and port is not None:
                return here, port
            here = here.parent
    return None


def _joined(
    space: Space,
    pipe: Element,
    boxes: Mapping[str, _Box],
    named: Mapping[int, str],
    links: Sequence[tuple[int, Element]],
) -> Iterator[Connection]:
    """Symbols at the ends of a pipe: the linked ones, else the nearest to an end."""
    path = _edge_path(pipe.values().get("edgepath", ""))
    ends = {named[key]: True for key, _ in links if key in named}
    through = [named[key] for key, _ in links if key in named]
    if len(through) < 2 and path:
        for x, y in (path[0], path[-1]):
            near = min(boxes, key=lambda name: boxes[name].distance(x, y), default=None)
            if near is not None and boxes[near].is_near(x, y):
                ends.setdefault(near, False)
    for one, other in itertools.pairwise(ends):
        linked = ends[one] and ends[other]
        yield Connection(ends=(one, other), linked=linked, pipe=space.name(pipe))


def _box(element: Element) -> _Box | None:
    texts = element.values()
    try:
        x, y = float(texts["x"]), float(texts["y"])
    except (KeyError, ValueError):
        return None
    try:
        return _Box(x, y, float(texts["width"]), float(texts["height"]))
    except (KeyError, ValueError):
        return _Box(x, y, 0.0, 0.0)


def _edge_path(text: str) -> list[tuple[float, float]]:
    """Corners of a pipe written as "30,113;107,113"; empty for any other form."""
    try:
        points = [point.split(",") for point in text.split(";") if point.strip()]
        return [(float(x), float(y)) for x, y in points]
    except ValueError:
        return []
