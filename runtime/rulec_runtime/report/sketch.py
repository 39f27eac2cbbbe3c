"""A small drawing of a plant: modules as boxes, connections as lines, findings marked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.report.text import counted, listed, safe
from rulec_runtime.report.topology import Topology, topology_of
from rulec_runtime.report.wording import STATUS

BOX, COLUMN, ROW, EDGE = (84, 28), 122, 40, 6
"""Width and height of a box, distances of columns and rows, and room around, CSS pixels."""

LETTERS = 9
"""Of a name that a box shows."""

WORST = ("F", "C", "S", "M")


def sketch(ruleset: Ruleset, marks: Mapping[str, str]) -> str:
    """The plant as SVG, with what the marks mean; `marks` are letters of NE 107 by module.

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
    body = "".join([*_lines(drawn, at, height), *_boxes(ruleset, drawn, known, at)])
    return (
        '<div class="sketch"><div class="scroll" tabindex="0" role="region" '
        f'aria-label="sketch of the plant"><svg width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" role="img" aria-label="{safe(_spoken(drawn, words))}">'
        f'{body}</svg></div><p class="key">{safe(words)}</p></div>'
    )


def _lines(drawn: Topology, at: Mapping[int, tuple[float, float]], height: int) -> Iterator[str]:
    half = BOX[1] / 2
    for a, b in drawn.pipes:
        (x, y), (to, down) = at[a], at[b]
        x, y, down = x + BOX[0], y + half, down + half
        bend = (COLUMN - BOX[0]) * 0.6
        path = f"M{x:g} {y:g}C{x + bend:g} {y:g} {to - bend:g} {down:g} {to - 5:g} {down:g}"
        yield f'<path class="pipe" d="{path}"/>{_head(to, down)}'
    for a, b in drawn.back:
        (x, y), (to, down) = at[a], at[b]
        foot = height - 3
        path = f"M{x + BOX[0] / 2:g} {y + BOX[1]:g}V{foot}H{to + BOX[0] / 2:g}V{down + BOX[1]:g}"
        yield f'<path class="pipe back" d="{path}"/>'


def _head(x: float, y: float) -> str:
    return f'<path class="head" d="M{x:g} {y:g}l-7-3.5v7z"/>'


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
    """How many modules, how many are drawn, and what is marked."""
    shown = sum(len(members) == 1 for members in drawn.boxes)
    count = len(ruleset.modules)
    parts = [counted(count, "module") if shown == count else f"{shown} of {count} modules drawn"]
    for letter in WORST:
        names = [name for name, own in marks.items() if own == letter]
        if names:
            more = [f"{len(names) - 5} more"] if len(names) > 6 else []
            told = listed([*(names[:5] if more else names), *more])
            parts.append(f"{STATUS[letter][0]} {letter} here: {told}")
    return "; ".join(parts)


def _spoken(drawn: Topology, words: str) -> str:
    """The drawing for those who cannot see it."""
    named = [m[0] if len(m) == 1 else f"{len(m)} further modules" for m in drawn.boxes]
    pipes = ", ".join(f"{named[a]} to {named[b]}" for a, b in (*drawn.pipes, *drawn.back))
    return f"Sketch of the plant: {words}. Connections: {pipes or 'none'}"
