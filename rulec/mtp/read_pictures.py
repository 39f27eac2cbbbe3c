"""Read from pictures which symbols a pipe joins; a file says so nowhere else.

Makers write this in three ways: links between ids of nozzles, links between ids of their
connectors, and pipes that merely end where a symbol is drawn.
"""

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
    links: dict[int, list[int]] = {}
    for one, other in _links(space, picture, owners):
        links.setdefault(id(one), []).append(id(other))
        links.setdefault(id(other), []).append(id(one))
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
) -> Iterator[tuple[Element, Element]]:
    """Pairs of linked symbols or pipes."""
    for link in (element for element in picture.walk() if element.tag == "InternalLink"):
        one, other = (_owner(space, link, f"RefPartnerSide{side}", owners) for side in "AB")
        if one is not None and other is not None and one is not other:
            yield one, other


def _owner(space: Space, link: Element, side: str, owners: Mapping[int, Element]) -> Element | None:
    """Symbol or pipe at a side of a link: `id`, `id:connector` or `id/connector` of its port."""
    partner = link.get(side)
    for text in (partner, partner.rpartition(":")[0], partner.rpartition("/")[0]):
        element = space.find(text, link) if text else None
        while element is not None:
            if id(element) in owners:
                return element
            element = element.parent
    return None


def _joined(
    space: Space,
    pipe: Element,
    boxes: Mapping[str, _Box],
    named: Mapping[int, str],
    links: Sequence[int],
) -> Iterator[Connection]:
    """Symbols at the ends of a pipe: the linked ones, else the nearest to an end."""
    path = _edge_path(pipe.values().get("edgepath", ""))
    linked = [named[key] for key in links if key in named]
    ends = dict.fromkeys(linked)
    if len(linked) < 2 and path:
        for x, y in (path[0], path[-1]):
            near = min(boxes, key=lambda name: boxes[name].distance(x, y), default=None)
            if near is not None and boxes[near].is_near(x, y):
                ends[near] = None
    for pair in itertools.pairwise(ends):
        yield Connection(ends=pair, linked={*pair} <= {*linked}, pipe=space.name(pipe))


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
