"""Draw a small sketch of a plant: modules as boxes, connections as lines, findings marked."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from rulec_runtime.contract.ruleset import Junction, Ruleset
from rulec_runtime.report.text import counted, listed, safe
from rulec_runtime.report.wording import STATUS

BOX, COLUMN, ROW, EDGE = (84, 28), 122, 40, 6
"""Width and height of a box, distances of columns and rows, and margin, CSS pixels."""

LETTERS = 9
"""Most letters of a name in a box."""

WORST = ("F", "C", "S", "M")


def sketch(ruleset: Ruleset, marks: Mapping[str, str]) -> str:
    """The plant as SVG with a legend; `marks` are letters of NE 107 by module.

    A module is marked by colour, by a thicker frame, and by the letter's symbol.
    """
    junctions = (*ruleset.junctions, *ruleset.unbalanced)
    known = {name: letter for name, letter in marks.items() if name in ruleset.modules}
    drawn = topology_of(ruleset.modules, junctions, known)
    rows = max(len(layer) for layer in drawn.layers)
    width = COLUMN * (len(drawn.layers) - 1) + BOX[0] + 2 * EDGE
    height = ROW * rows + (ROW // 2 if drawn.back else 0)
    at = {
        box: (EDGE + COLUMN * depth, ROW * (place + (rows - len(layer)) / 2) + EDGE)
        for depth, layer in enumerate(drawn.layers)
        for place, box in enumerate(layer)
    }
    words = _words(ruleset, drawn, known)
    named = [m[0] if len(m) == 1 else f"{len(m)} further modules" for m in drawn.boxes]
    pipes = ", ".join(f"{named[a]} to {named[b]}" for a, b in (*drawn.pipes, *drawn.back))
    spoken = f"Sketch of the plant: {words}. Connections: {pipes or 'none'}"
    body = "".join([*_lines(drawn, at, height), *_boxes(ruleset, drawn, known, at)])
    return (
        '<div class="sketch"><div class="scroll" tabindex="0" role="region" '
        f'aria-label="sketch of the plant"><svg width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" role="img" aria-label="{safe(spoken)}">'
        f'{body}</svg></div><p class="key">{safe(words)}</p></div>'
    )


def _lines(drawn: Topology, at: Mapping[int, tuple[float, float]], height: int) -> Iterator[str]:
    half = BOX[1] / 2
    for a, b in drawn.pipes:
        (x, y), (to, down) = at[a], at[b]
        x, y, down = x + BOX[0], y + half, down + half
        bend = (COLUMN - BOX[0]) * 0.6
        path = f"M{x:g} {y:g}C{x + bend:g} {y:g} {to - bend:g} {down:g} {to - 5:g} {down:g}"
        yield f'<path class="pipe" d="{path}"/><path class="head" d="M{to:g} {down:g}l-7-3.5v7z"/>'
    for a, b in drawn.back:
        (x, y), (to, down) = at[a], at[b]
        foot = height - 3
        path = f"M{x + BOX[0] / 2:g} {y + BOX[1]:g}V{foot}H{to + BOX[0] / 2:g}V{down + BOX[1]:g}"
        yield f'<path class="pipe back" d="{path}"/>'


def _boxes(
    ruleset: Ruleset,
    drawn: Topology,
    marks: Mapping[str, str],
    at: Mapping[int, tuple[float, float]],
) -> Iterator[str]:
    for i, members in enumerate(drawn.boxes):
        (x, y), one = at[i], members[0]
        letter = marks.get(one, "") if len(members) == 1 else ""
        style = f"box is-{letter}" if letter else "box" if len(members) == 1 else "box fold"
        symbol = f"{STATUS[letter][0]} " if letter else ""
        name = one if len(members) == 1 else f"+ {len(members)} more"
        room = LETTERS - (1 if symbol else 0)
        if len(members) == 1 and len(name) > room:
            name = f"{name[: room - 1]}…"
        full = f"{one}: {ruleset.modules[one]}" if len(members) == 1 else ", ".join(members[:40])
        yield (
            f'<g class="{style}"><title>{safe(full)}</title>'
            f'<rect x="{x:g}" y="{y:g}" width="{BOX[0]}" height="{BOX[1]}" rx="3"/>'
            f'<text x="{x + BOX[0] / 2:g}" y="{y + BOX[1] / 2:g}">{safe(symbol + name)}</text></g>'
        )


def _words(ruleset: Ruleset, drawn: Topology, marks: Mapping[str, str]) -> str:
    shown = sum(len(members) == 1 for members in drawn.boxes)
    count = len(ruleset.modules)
    parts = [counted(count, "module") if shown == count else f"{shown} of {count} modules drawn"]
    for letter in WORST:
        names = [name for name, own in marks.items() if own == letter]
        if names:
            shorter = names if len(names) <= 6 else [*names[:5], f"{len(names) - 5} more"]
            parts.append(f"{STATUS[letter][0]} {letter} here: {listed(shorter)}")
    return "; ".join(parts)


MOST = 12
"""Most modules drawn individually."""

FOLDS = 4
"""Most boxes of folded modules; if there are more, one box holds all."""

SWEEPS = 3
"""How often boxes are sorted by the height of their neighbours."""

Pipes = set[tuple[int, int]]
"""Connections between the indices of boxes, in the direction of flow."""


@dataclass(frozen=True)
class Topology:
    """Boxes, each with its modules, their layers, and pipes between them.

    `back` are pipes against the order of the layers: they close loops.
    """

    boxes: tuple[tuple[str, ...], ...]
    layers: tuple[tuple[int, ...], ...]
    pipes: tuple[tuple[int, int], ...]
    back: tuple[tuple[int, int], ...]


def topology_of(
    modules: Iterable[str], junctions: Iterable[Junction], marked: Iterable[str] = ()
) -> Topology:
    """The part of a plant to draw; `marked` modules take precedence.

    >>> topology_of("ABC", [Junction(("A", "B"), ("C",))]).layers
    ((0, 1), (2,))
    """
    names = list(modules)
    pairs = [(o, i) for j in junctions for o in j.outlets for i in j.inlets]
    boxes: list[tuple[str, ...]] = [(name,) for name in names]
    if len(names) > MOST:
        boxes = _folded(names, pairs, [m for m in names if m in set(marked)])
    of = {name: i for i, members in enumerate(boxes) for name in members}
    pipes = {(of[a], of[b]) for a, b in pairs if a in of and b in of and of[a] != of[b]}
    back = _back(len(boxes), pipes)
    layers = _layers(len(boxes), pipes - back)
    return Topology(tuple(boxes), layers, tuple(sorted(pipes - back)), tuple(sorted(back)))


def _folded(
    names: Sequence[str], pairs: Sequence[tuple[str, str]], marked: Sequence[str]
) -> list[tuple[str, ...]]:
    """Boxes of a large plant: marked modules and those around them alone, the others in groups of
    connected ones and of those with the same neighbours."""
    order = {name: i for i, name in enumerate(names)}
    beside: dict[str, dict[str, None]] = {name: {} for name in names}
    for a, b in pairs:
        beside[a][b] = beside[b][a] = None
    shown = [*marked, *names[: not marked]][:MOST]
    for name in shown:  # grows meanwhile
        shown += [n for n in beside[name] if n not in shown][: MOST - len(shown)]
    shown += [name for name in names if name not in shown][: MOST - len(shown)]
    groups: dict[frozenset[str], list[str]] = {}
    rest = dict.fromkeys(name for name in names if name not in shown)
    while rest:
        part, ends = [next(iter(rest))], set[str]()
        del rest[part[0]]
        for name in part:  # grows meanwhile
            ends.update(other for other in beside[name] if other in shown)
            new = [other for other in beside[name] if other in rest]
            part += new
            for other in new:
                del rest[other]
        groups.setdefault(frozenset(ends), []).extend(part)
    folded = [tuple(sorted(part, key=order.__getitem__)) for part in groups.values()]
    if len(folded) > FOLDS:
        folded = [tuple(name for name in names if name not in shown)]
    return sorted([*((n,) for n in shown), *folded], key=lambda members: order[members[0]])


def _back(count: int, pipes: Pipes) -> Pipes:
    """Pipes that close a loop, by depth-first search from the sources."""
    entered, done, found = {b for _, b in pipes}, set[int](), Pipes()

    def follow(box: int, way: frozenset[int]) -> None:
        for target in sorted(b for a, b in pipes if a == box):
            if target in way:
                found.add((box, target))
            elif target not in done:
                follow(target, way | {target})
        done.add(box)

    for root in sorted(range(count), key=lambda i: i in entered):
        if root not in done:
            follow(root, frozenset((root,)))
    return found


def _layers(count: int, pipes: Pipes) -> tuple[tuple[int, ...], ...]:
    """Boxes by their longest path from a source; a source goes just before the box it feeds."""
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
    at = [0.0] * count
    for sweep in range(SWEEPS + 1):
        for layer in layers if sweep % 2 else reversed(layers):
            if sweep:
                layer.sort(key=lambda i: _height(i, pipes, at))
            for place, box in enumerate(layer):
                at[box] = place - (len(layer) - 1) / 2
    return tuple(map(tuple, layers))


def _height(box: int, pipes: Pipes, at: Sequence[float]) -> float:
    """The mean height of the neighbours of a box."""
    beside = [at[a if b == box else b] for a, b in pipes if box in (a, b)]
    return sum(beside) / len(beside) if beside else at[box]
