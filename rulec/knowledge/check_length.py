"""Refuse equations that become too long or too deep when definitions are written out."""

from __future__ import annotations

from collections.abc import Iterable

from rulec.language.diagnostics import Diagnostic
from rulec.language.document import Document
from rulec.language.expression import Expression
from rulec.language.length import Length, length_of

Path = tuple[str | int, ...]

MOST = 40_000
"""Work that the equations of one file may be. Origin: more than twice that of the longest shipped
module type, straight-pipe, with 17,042; measured, 4000 are differentiated in about a second."""

DEEPEST = 150
"""Operations inside one another, through all definitions. Origin: eight times the 18 of
straight-pipe; Python's own stack carries about three times as many."""

LAW = 300
"""Work that the law of a fault may be, which is put into all equations. Shipped laws have 40."""


def check_lengths(
    document: Document,
    definitions: Iterable[tuple[str, Path, Expression]],
    equations: Iterable[tuple[Path, Expression]],
    found: list[Diagnostic],
) -> None:
    """Add a mistake where definitions (in order of use) or what stands on them grow too long."""
    known: dict[str, Length] = {}
    for name, path, expression in definitions:
        known[name] = length_of(expression, known)
        if _refused(document, path, known[name], MOST, found):
            return
    total = 0
    for path, expression in equations:
        length = length_of(expression, known)
        total += length.work
        if _refused(document, path, length, MOST - (total - length.work), found):
            return


def check_law(document: Document, path: Path, law: Expression, found: list[Diagnostic]) -> bool:
    """Whether the law of a fault is short enough; else a mistake is added."""
    return not _refused(document, path, length_of(law, {}), LAW, found)


def _refused(
    document: Document, path: Path, length: Length, most: int, found: list[Diagnostic]
) -> bool:
    if length.depth > DEEPEST:
        message = f"with its definitions written out this is nested {length.depth} deep"
        hint = f"{DEEPEST} at most: let fewer definitions stand on one another"
    elif length.work > most:
        message = "with all definitions written out, this and its derivatives become too long"
        hint = "use a long definition once, not several times; leave out what matters little"
    else:
        return False
    found.append(Diagnostic(document.place(*path), "KB042", message, hint))
    return True
