"""Where a figure is printed: a text with `{id}` for it, `{...}` for anything in the same block.

`{id}` is written as `:g` writes it, `{id:.2f}` with a format, `{id:.0%}` in per cent, `{id#count}`
is another field of the figure. White space is any white space, also the end of a line.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from tests.figures.ledger import Figure

HOLE = re.compile(r"\{(\.\.\.|[A-Za-z][\w.-]*(?:#\w+)?(?::[^{}]+)?)\}")
NUMBER = r"[-−+]?\d+(?:[ ,]\d{3}(?!\d))*(?:\.\d+)?"


@dataclass(frozen=True)
class Found:
    """A template met on a page: where, and the text of each figure there with its place."""

    start: int
    end: int
    printed: tuple[tuple[str, int, int], ...]


def holes(template: str) -> list[str]:
    """The figures of a template, as they are written in it, without what stands for anything."""
    return [hole for hole in HOLE.findall(template) if hole != "..."]


def figure_of(hole: str) -> str:
    """The figure's id: `zema.weak` of `zema.weak#count` and of `zema.weak:.2f`."""
    return re.split("[#:]", hole)[0]


def rendered(hole: str, figures: Mapping[str, Figure]) -> str:
    """What should stand in the place of a hole; raises KeyError for an unknown figure."""
    name, _, spec = hole.partition(":")
    name, _, part = name.partition("#")
    value = getattr(figures[name], part or "value")
    if spec.endswith("%"):
        return f"{100 * value:{spec[:-1]}f}"
    return f"{value:{spec or 'g'}}"


def find(template: str, text: str, figures: Mapping[str, Figure] | None = None) -> Found | None:
    """Where a text holds the template: with these figures; without, with any numbers."""
    match = re.search(_pattern(template, figures), text, re.DOTALL)
    if match is None:
        return None
    spans = [(hole, *match.span(k + 1)) for k, hole in enumerate(holes(template))]
    return Found(match.start(), match.end(), tuple(spans))


REST = r"(?:(?!\n\s*\n|\n\s*(?:[-*|#]|\d+\.)).)*"
"""The rest of a paragraph, a list item or a row."""


def everywhere(template: str, text: str) -> list[tuple[int, int]]:
    """Start and end of every passage that the template fits, with any numbers."""
    return [match.span() for match in re.finditer(_pattern(template, None), text, re.DOTALL)]


def _pattern(template: str, figures: Mapping[str, Figure] | None) -> str:
    parts = HOLE.split(template)
    pattern = []
    for k, part in enumerate(parts):
        if k % 2 == 0:
            pattern.append(r"\s+".join(re.escape(word) for word in re.split(r"\s+", part)))
        elif part == "...":
            pattern.append(r"(?:(?!\n\s*\n).)*?" if k + 2 < len(parts) or parts[-1] else REST)
        else:
            pattern.append(f"({re.escape(rendered(part, figures)) if figures else NUMBER})")
    return "".join(pattern)


def replaced(template: str, text: str, figures: Mapping[str, Figure]) -> str:
    """The text with today's figures in the place of the numbers that stand there."""
    found = find(template, text)
    if found is None:
        raise ValueError(f"nowhere on its page: {template}")
    for hole, start, end in reversed(found.printed):
        text = text[:start] + rendered(hole, figures) + text[end:]
    return text
