"""Refuse equations that become too long or too deep when definitions are written out."""

from __future__ import annotations

from collections.abc import Iterable

from rulec.language.document import Path_
from rulec.language.expression import Expression
from rulec.language.length import Length, length_of
from rulec.language.reader import Reader

MOST = 40_000
"""Work that the equations of one file may be. Origin: more than twice that of the longest shipped
module type, straight-pipe, with 17,042; measured, 4000 are differentiated in about a second."""

DEEPEST = 150
"""Operations inside one another, through all definitions. Origin: eight times the 18 of
straight-pipe; Python's own stack carries about three times as many."""

LAW = 300
"""Work that the law of a fault may be, which is put into all equations. Shipped laws have 40."""


def check_lengths(
    reader: Reader,
    definitions: Iterable[tuple[Path_, Expression]],
    equations: Iterable[tuple[Path_, Expression]],
) -> None:
    """Report where definitions (in order of use) or what stands on them grow too long.

    A definition is known by the last but one key of its path.
    """
    known: dict[str, Length] = {}
    for path, expression in definitions:
        known[str(path[-2])] = length = length_of(expression, known)
        if _is_refused(reader, path, length, MOST):
            return
    total = 0
    for path, expression in equations:
        length = length_of(expression, known)
        if _is_refused(reader, path, length, MOST - total):
            return
        total += length.work


def check_law(reader: Reader, path: Path_, law: Expression) -> bool:
    """Whether the law of a fault is short enough; else a mistake is reported."""
    return not _is_refused(reader, path, length_of(law, {}), LAW)


def _is_refused(reader: Reader, path: Path_, length: Length, most: int) -> bool:
    if length.depth > DEEPEST:
        message = f"with its definitions written out this is nested {length.depth} deep"
        hint = f"{DEEPEST} at most: let fewer definitions stand on one another"
    elif length.work > most:
        message = "with all definitions written out, this and its derivatives become too long"
        hint = "use a long definition once, not several times; leave out what matters little"
    else:
        return False
    reader.report(path, "KB042", message, hint)
    return True
