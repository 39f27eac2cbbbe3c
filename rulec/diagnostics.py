"""A mistake in a knowledge or plant file, as a value with its place."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, order=True)
class Place:
    """A spot in a text file; `line` and `column` count from 1."""

    file: str
    line: int = 1
    column: int = 1
    length: int = 1


@dataclass(frozen=True, order=True)
class Diagnostic:
    """One mistake: where, which kind, what, and what to do.

    `code` identifies the reason (docs/errors.md); `hint` is the remedy; `second` is the other
    place where two places contradict each other.
    """

    place: Place
    code: str
    message: str
    hint: str = ""
    second: Place | None = None


class Refused(Exception):
    """Raised at the end of a pass that found mistakes; carries all of them."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(sorted(set(diagnostics)))
        super().__init__(f"{len(self.diagnostics)} mistake(s)")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Suggest the nearest known name, or list the few that exist.

    >>> did_you_mean("k_leek", ["k_leak", "V"])
    "did you mean 'k_leak'?"
    """
    names = sorted(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if near:
        return f"did you mean '{near[0]}'?"
    if not names:
        return ""
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"known: {shown}"


def render(diagnostic: Diagnostic) -> str:
    """Write a diagnostic as text: place, message, excerpt with caret, remedy."""
    place = diagnostic.place
    head = f"{diagnostic.code} {place.file}:{place.line}:{place.column}: {diagnostic.message}"
    lines = [head, *_excerpt(place, diagnostic.hint)]
    if diagnostic.second is not None:
        second = diagnostic.second
        lines.append(f"  see also {second.file}:{second.line}:{second.column}")
        lines.extend(_excerpt(second, ""))
    return "\n".join(lines)


def render_all(diagnostics: Iterable[Diagnostic]) -> str:
    """Write all diagnostics, sorted by place, with a closing count."""
    found = sorted(set(diagnostics))
    files = len({d.place.file for d in found})
    count = f"{len(found)} mistake{'s' * (len(found) != 1)} in {files} file{'s' * (files != 1)}"
    return "\n".join([*(render(d) for d in found), count])


def _excerpt(place: Place, hint: str) -> list[str]:
    """Quote the line of a place with a caret under the offending part."""
    try:
        text = Path(place.file).read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError:
        return [f"  {hint}"] if hint else []
    if not 1 <= place.line <= len(text):
        return [f"  {hint}"] if hint else []
    source = text[place.line - 1].replace("\t", " ")
    start = min(place.column - 1, max(len(source), 0))
    length = max(1, min(place.length, len(source) - start))
    shift = max(0, start - 60)
    gutter = f"{place.line:>5} | "
    shown = source[shift : shift + 96]
    caret = " " * (len(gutter) - 2) + "| " + " " * (start - shift) + "^" * min(length, 90)
    return [_printable(gutter + shown), f"{caret} {hint}".rstrip()]


def _printable(text: str) -> str:
    """Replace control characters: a hostile file must not steer the terminal."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
