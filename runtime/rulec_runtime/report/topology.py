"""A plant as boxes in layers from left to right: what is drawn, what is folded, where it stands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from rulec_runtime.contract.ruleset import Junction

MOST = 12
"""Modules drawn each for itself."""

FOLDS = 4
"""Boxes of folded modules; of more all are one."""

SWEEPS = 3
"""Times that boxes are put in order of what they are connected to."""

Pipes = set[tuple[int, int]]
"""Connections between boxes by their numbers, in the direction of flow."""


@dataclass(frozen=True)
class Topology:
    """Boxes, each with the modules that it stands for, their layers, and pipes between them.

    `back` are pipes that lead against the layers: the plant has a loop there.
    """

    boxes: tuple[tuple[str, ...], ...]
    layers: tuple[tuple[int, ...], ...]
    pipes: tuple[tuple[int, int], ...]
    back: tuple[tuple[int, int], ...]


def topology_of(
    modules: Iterable[str], junctions: Iterable[Junction], marked: Iterable[str] = ()
) -> Topology:
    """What is drawn of a plant; `marked` modules are, before others.

    >>> topology_of("ABC", [Junction(("A", "B"), ("C",))]).layers
    ((0, 1), (2,))
    """
    names = list(modules)
    pairs = [(o, i) for j in junctions for o in j.outlets for i in j.inlets]
    boxes = _boxes(names, pairs, [m for m in names if m in set(marked)])
    of = {name: i for i, members in enumerate(boxes) for name in members}
    pipes = {(of[a], of[b]) for a, b in pairs if a in of and b in of and of[a] != of[b]}
    back = _back(len(boxes), pipes)
    layers = _layers(len(boxes), pipes - back)
    return Topology(tuple(boxes), layers, tuple(sorted(pipes - back)), tuple(sorted(back)))


def _boxes(
    names: Sequence[str], pairs: Sequence[tuple[str, str]], marked: Sequence[str]
) -> list[tuple[str, ...]]:
    if len(names) <= MOST:
        return [(name,) for name in names]
    beside: dict[str, dict[str, None]] = {name: {} for name in names}
    for a, b in pairs:
        beside[a][b] = beside[b][a] = None
    shown: dict[str, None] = dict.fromkeys([*marked, *names[: not marked]][:MOST])
    for name in (queue := list(shown)):
        new = [n for n in beside[name] if n not in shown][: MOST - len(shown)]
        shown.update(dict.fromkeys(new))
        queue += new
    for name in names:
        if len(shown) < MOST:
            shown[name] = None
    groups = _folded([n for n in names if n not in shown], beside, shown)
    order = {name: i for i, name in enumerate(names)}
    return sorted([*((n,) for n in shown), *groups], key=lambda members: order[members[0]])


def _folded(
    rest: Sequence[str], beside: Mapping[str, Iterable[str]], shown: Mapping[str, None]
) -> list[tuple[str, ...]]:
    """Modules that are not drawn: those together that hang together, or on the same ones."""
    groups: dict[frozenset[str], list[str]] = {}
    seen: set[str] = set()
    for start in rest:
        if start in seen:
            continue
        seen.add(start)
        part, ends = [start], set[str]()
        for name in part:
            for other in beside[name]:
                if other in shown:
                    ends.add(other)
                elif other not in seen:
                    seen.add(other)
                    part.append(other)
        groups.setdefault(frozenset(ends), []).extend(part)
    order = {name: i for i, name in enumerate(rest)}
    folded = [tuple(sorted(part, key=order.__getitem__)) for part in groups.values()]
    return folded if len(folded) <= FOLDS else [tuple(rest)]


def _back(count: int, pipes: Pipes) -> Pipes:
    """Pipes that close a loop, found depth first."""
    after = {i: sorted(b for a, b in pipes if a == i) for i in range(count)}
    entered = {b for _, b in pipes}
    begin = sorted(range(count), key=lambda i: i in entered)
    found: Pipes = set()
    done: set[int] = set()
    for root in begin:
        path: list[tuple[int, list[int]]] = [] if root in done else [(root, list(after[root]))]
        on = {root}
        while path:
            box, left = path[-1]
            if not left:
                path.pop()
                on.discard(box)
                done.add(box)
                continue
            target = left.pop(0)
            if target in on:
                found.add((box, target))
            elif target not in done:
                on.add(target)
                path.append((target, list(after[target])))
    return found


def _layers(count: int, pipes: Pipes) -> tuple[tuple[int, ...], ...]:
    """Boxes by their longest way from a source; a source stands just before what it feeds."""
    level = [0] * count
    for _ in range(count):
        for a, b in pipes:
            level[b] = max(level[b], level[a] + 1)
    entered = {b for _, b in pipes}
    for i in range(count):
        fed = [level[b] for a, b in pipes if a == i]
        if fed and i not in entered:
            level[i] = min(fed) - 1
    depths = range(max(level, default=0) + 1)
    layers = [[i for i in range(count) if level[i] == depth] for depth in depths]
    at = {i: place for layer in layers for i, place in _centred(layer)}
    for sweep in range(SWEEPS):
        for layer in layers if sweep % 2 == 0 else reversed(layers):
            wanted = {i: _wanted(i, pipes, at) for i in layer}
            layer.sort(key=wanted.__getitem__)
            at.update(_centred(layer))
    return tuple(map(tuple, layers))


def _centred(layer: Sequence[int]) -> list[tuple[int, float]]:
    return [(box, place - (len(layer) - 1) / 2) for place, box in enumerate(layer)]


def _wanted(box: int, pipes: Pipes, at: Mapping[int, float]) -> float:
    """The mean height of what a box is connected to."""
    beside = [at[a if b == box else b] for a, b in pipes if box in (a, b)]
    return sum(beside) / len(beside) if beside else at[box]
