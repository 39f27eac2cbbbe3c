"""Read from pictures which symbols a pipe joins; a file says so nowhere else.

Makers write this in three ways: links between ids of nozzles, links between ids of their
connectors, and pipes that merely end where a symbol is drawn.
"""

import itertools
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from rulec.mtp import limits
from rulec.mtp.caex import Element
from rulec.mtp.space import Space

Box = tuple[float, float, float, float]
"""Left and upper edge, width and height."""


def read_pictures(
    space: Space, parts: Sequence[Element]
) -> tuple[tuple[tuple[str, str], ...], tuple[dict[str, Any], ...]]:
    """Symbols with their codes, and the pairs that a pipe joins, in JSON form."""
    symbols: list[tuple[str, str]] = []
    found: list[dict[str, Any]] = []
    for picture in (e for part in parts for e in part.inside() if space.is_a(e, "Picture")):
        inside = (e for e in picture.inside() if e is not picture)
        things = [e for e in inside if not space.passes(e, "PortObject")]
        pipes = {id(e): e for e in things if space.is_a(e, "Pipe")}
        drawn = {id(e): e for e in things if not space.passes(e, "Connection")}
        names: dict[int, str] = {}
        counts: Counter[str] = Counter()
        boxes: dict[str, Box] = {}
        for key, element in drawn.items():
            name, texts = space.name(element) or "symbol", element.values()
            counts[name] += 1
            names[key] = name if counts[name] == 1 else f"{name} ({counts[name]})"
            symbols.append((names[key], texts.get("eclassclassificationclass", "").strip()))
            if corner := _numbers([texts.get("x", ""), texts.get("y", "")]):
                size = _numbers([texts.get("width", ""), texts.get("height", "")]) or (0.0, 0.0)
                boxes[names[key]] = (*corner, *size)
        if max(len(boxes), len(pipes)) > limits.MOST_DRAWN:
            boxes = {}
        links = _links(space, picture, {*pipes, *drawn})
        for key, pipe in pipes.items():
            linked = [names[k] for k in links.get(key, ()) if k in names]
            near = _near(pipe, boxes) if len(linked) < 2 else ()
            for pair in itertools.pairwise(dict.fromkeys((*linked, *near))):
                is_linked = {*pair} <= {*linked}
                found.append({"ends": pair, "linked": is_linked, "pipe": space.name(pipe)})
    return tuple(symbols), tuple(found)


def _numbers(texts: Sequence[str]) -> tuple[float, float] | None:
    """Two numbers; None for anything else."""
    try:
        first, second = map(float, texts)
    except ValueError:
        return None
    return first, second


def _links(space: Space, picture: Element, owners: Collection[int]) -> dict[int, list[int]]:
    """What each symbol or pipe is linked with, by identities of elements."""
    links: dict[int, list[int]] = {}
    for link in (element for element in picture.walk() if element.tag == "InternalLink"):
        one, other = (_owner(space, link, f"RefPartnerSide{side}", owners) for side in "AB")
        if one is not None and other is not None and one != other:
            links.setdefault(one, []).append(other)
            links.setdefault(other, []).append(one)
    return links


def _owner(space: Space, link: Element, side: str, owners: Collection[int]) -> int | None:
    """Symbol or pipe at a side of a link: `id`, `id:connector` or `id/connector` of its port."""
    partner = link.get(side)
    for text in (partner, partner.rpartition(":")[0], partner.rpartition("/")[0]):
        element = space.find(text, link) if text else None
        while element is not None:
            if id(element) in owners:
                return id(element)
            element = element.parent
    return None


def _near(pipe: Element, boxes: Mapping[str, Box]) -> Iterator[str]:
    """Symbols at the ends of a pipe, whose corners are written as "30,113;107,113"."""
    corners = pipe.values().get("edgepath", "").split(";")
    path = [_numbers(corner.split(",")) for corner in corners if corner.strip()]
    if not boxes or not path or None in path:
        return
    for x, y in (end for end in (path[0], path[-1]) if end is not None):
        away = {name: _distance(box, x, y) for name, box in boxes.items()}
        name = min(away, key=away.__getitem__)
        if away[name] <= limits.NEAR_SYMBOL * min(boxes[name][2:]):
            yield name


def _distance(box: Box, x: float, y: float) -> float:
    """From the edge of a box outwards; 0 inside."""
    left, top, width, height = box
    dx = max(left - x, 0.0, x - left - width)
    dy = max(top - y, 0.0, y - top - height)
    return float((dx * dx + dy * dy) ** 0.5)
