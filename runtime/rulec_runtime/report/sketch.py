"""Draw a small sketch of a plant: modules as boxes, connections as lines, findings marked."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from rulec_runtime.contract.ruleset import Junction, Ruleset
from rulec_runtime.report.text import counted, listed, safe
from rulec_runtime.report.wording import STATUS

BOX, COLUMN, ROW, EDGE = (84, 28), 122, 40, 6
"""Width and height of a box, distances of columns and rows, and margin, CSS pixels."""

LETTERS = 9
"""Most letters of a name in a box."""

MOST = 12
"""Most modules drawn individually."""

Pipes = Sequence[tuple[int, int]]
"""Connections between the indices of boxes, in the direction of flow."""


def sketch(ruleset: Ruleset, marks: Mapping[str, str]) -> str:
    """The plant as SVG with a legend; `marks` are letters of NE 107 by module.

    A module is marked by colour, by a thicker frame, and by the letter's symbol.
    """
    junctions = (*ruleset.junctions, *ruleset.unbalanced)
    letters = {name: letter for name, letter in marks.items() if name in ruleset.modules}
    boxes, pipes = topology_of(ruleset.modules, junctions, letters)
    layers = layers_of(len(boxes), pipes)
    rows = max(map(len, layers))
    at = {
        box: (EDGE + COLUMN * depth, ROW * (row + (rows - len(layer)) / 2) + EDGE)
        for depth, layer in enumerate(layers)
        for row, box in enumerate(layer)
    }
    width, height = COLUMN * (len(layers) - 1) + BOX[0] + 2 * EDGE, ROW * rows + ROW // 2
    words = _words(ruleset, sum(len(members) == 1 for members in boxes), letters)
    named = [m[0] if len(m) == 1 else f"{len(m)} further modules" for m in boxes]
    spoken = ", ".join(f"{named[a]} to {named[b]}" for a, b in pipes) or "none"
    body = "".join([*_lines(pipes, at, height - 3), *_boxes(ruleset, boxes, letters, at)])
    return (
        '<div class="sketch"><div class="scroll" tabindex="0" role="region" '
        f'aria-label="sketch of the plant"><svg width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" role="img" aria-label="Sketch of the plant: '
        f'{safe(words)}. Connections: {safe(spoken)}">'
        f'{body}</svg></div><p class="key">{safe(words)}</p></div>'
    )


def _lines(pipes: Pipes, at: Mapping[int, tuple[float, float]], foot: float) -> Iterator[str]:
    """Connections; one that closes a loop runs back below all boxes."""
    bend = (COLUMN - BOX[0]) * 0.6
    for a, b in pipes:
        (x, y), (to, down) = at[a], at[b]
        if x < to:
            x, y, down = x + BOX[0], y + BOX[1] / 2, down + BOX[1] / 2
            path = f"M{x:g} {y:g}C{x + bend:g} {y:g} {to - bend:g} {down:g} {to - 5:g} {down:g}"
            yield f'<path class="pipe" d="{path}"/>'
            yield f'<path class="head" d="M{to:g} {down:g}l-7-3.5v7z"/>'
        else:
            x, y, to, down = x + BOX[0] / 2, y + BOX[1], to + BOX[0] / 2, down + BOX[1]
            yield f'<path class="pipe back" d="M{x:g} {y:g}V{foot:g}H{to:g}V{down:g}"/>'


def _boxes(
    ruleset: Ruleset,
    boxes: Sequence[Sequence[str]],
    marks: Mapping[str, str],
    at: Mapping[int, tuple[float, float]],
) -> Iterator[str]:
    for i, members in enumerate(boxes):
        (x, y), name = at[i], members[0]
        full, letter = f"{name}: {ruleset.modules[name]}", marks.get(name, "")
        style = f"box is-{letter}" if letter else "box"
        symbol = f"{STATUS[letter][0]} " if letter else ""
        room = LETTERS - len(symbol) // 2
        shown = symbol + (name if len(name) <= room else f"{name[: room - 1]}…")
        if len(members) > 1:
            full, style, shown = ", ".join(members[:40]), "box fold", f"+ {len(members)} more"
        yield (
            f'<g class="{style}"><title>{safe(full)}</title>'
            f'<rect x="{x:g}" y="{y:g}" width="{BOX[0]}" height="{BOX[1]}" rx="3"/>'
            f'<text x="{x + BOX[0] / 2:g}" y="{y + BOX[1] / 2:g}">{safe(shown)}</text></g>'
        )


def _words(ruleset: Ruleset, shown: int, marks: Mapping[str, str]) -> str:
    count = len(ruleset.modules)
    parts = [counted(count, "module") if shown == count else f"{shown} of {count} modules drawn"]
    for letter in (letter for letter in STATUS if letter != "ok"):
        names = [name for name, own in marks.items() if own == letter]
        if names:
            shorter = names if len(names) <= 6 else [*names[:5], f"{len(names) - 5} more"]
            parts.append(f"{STATUS[letter][0]} {letter} here: {listed(shorter)}")
    return "; ".join(parts)


def topology_of(
    modules: Iterable[str], junctions: Iterable[Junction], marked: Iterable[str] = ()
) -> tuple[list[tuple[str, ...]], list[tuple[int, int]]]:
    """The boxes of a plant, each with its modules, and the pipes between them.

    Of a large plant marked modules and those around them are drawn alone; of the others one box
    holds those upstream of them, and one the rest.

    >>> topology_of("ABC", [Junction(("A", "B"), ("C",))])
    ([('A',), ('B',), ('C',)], [(0, 2), (1, 2)])
    """
    names, first = list(modules), list(marked)
    pairs = [(o, i) for j in junctions for o in j.outlets for i in j.inlets]
    alone = first or names[:1]
    for name in alone:  # grows meanwhile
        near = [b if a == name else a for a, b in pairs if name in (a, b)]
        alone += [n for n in dict.fromkeys(near) if n not in alone][: max(MOST - len(alone), 0)]
    alone += [name for name in names if name not in alone]
    alone = alone[:MOST]
    upstream = set(alone)
    while more := {a for a, b in pairs if b in upstream} - upstream:
        upstream |= more
    rest = [name for name in names if name not in alone]
    folded = [tuple(n for n in rest if (n in upstream) is way) for way in (True, False)]
    boxes = [(name,) for name in names if name in alone] + [box for box in folded if box]
    of = {name: i for i, members in enumerate(boxes) for name in members}
    pipes = {(of[a], of[b]) for a, b in pairs if a in of and b in of and of[a] != of[b]}
    return boxes, sorted(pipes)


def layers_of(count: int, pipes: Pipes) -> list[list[int]]:
    """Boxes by their longest path from a source, each near the height of those that feed it; a
    source goes just before the box it feeds.

    >>> layers_of(4, [(0, 1), (3, 1), (1, 2), (2, 3)])
    [[0], [1], [2], [3]]
    """
    feeders = [[a for a, b in pipes if b == box] for box in range(count)]
    order = sorted(range(count), key=lambda box: len(feeders[box]) > 0)
    level: dict[int, int] = {}

    def follow(box: int, depth: int, way: frozenset[int]) -> None:
        if depth > level.get(box, -1):
            level[box] = depth
            for target in (b for a, b in pipes if a == box and b not in way):
                follow(target, depth + 1, way | {target})

    for root in order:
        if root not in level:
            follow(root, 0, frozenset((root,)))
    for box in range(count):
        fed = [level[b] for a, b in pipes if a == box]
        if fed and not feeders[box]:
            level[box] = min(fed) - 1
    layers = [[b for b in range(count) if level[b] == depth] for depth in range(count)]
    height: dict[int, float] = {}
    for layer in layers:
        near = {box: [height[a] for a in feeders[box] if a in height] for box in layer}
        layer.sort(key=lambda box: sum(near[box]) / len(near[box]) if near[box] else 0.0)
        height |= {box: i - (len(layer) - 1) / 2 for i, box in enumerate(layer)}
    return [layer for layer in layers if layer]
