"""Refuse equations that become too long or too deep when definitions are written out."""

from __future__ import annotations

from collections.abc import Iterable

from rulec.language.document import Path_
from rulec.language.expression import Expression
from rulec.language.length import Length, length_of
from rulec.language.reader import Reader
from rulec.limits import MAX_LAW_WORK, MAX_WORK, MAX_WRITTEN_DEPTH


def check_lengths(
    reader: Reader,
    definitions: Iterable[tuple[Path_, Expression]],
    equations: Iterable[tuple[Path_, Expression]],
) -> None:
    """Report definitions (in order of use) or equations over them that grow too long.

    The last but one key of its path is the name of a definition.
    """
    known: dict[str, Length] = {}
    for path, expression in definitions:
        known[str(path[-2])] = length = length_of(expression, known)
        if _is_refused(reader, path, length, MAX_WORK):
            return
    total = 0
    for path, expression in equations:
        length = length_of(expression, known)
        if _is_refused(reader, path, length, MAX_WORK - total):
            return
        total += length.work


def check_law(reader: Reader, path: Path_, law: Expression) -> bool:
    """Whether the law of a fault is short enough; otherwise a mistake is reported."""
    return not _is_refused(reader, path, length_of(law, {}), MAX_LAW_WORK)


def _is_refused(reader: Reader, path: Path_, length: Length, most: int) -> bool:
    if length.depth > MAX_WRITTEN_DEPTH:
        message = f"with its definitions written out this is nested {length.depth} deep"
        hint = f"{MAX_WRITTEN_DEPTH} at most: let fewer definitions stand on one another"
    elif length.work > most:
        message = "with all definitions written out, this and its derivatives become too long"
        hint = "use a long definition once, not several times; leave out what matters little"
    else:
        return False
    reader.report(path, "KB042", message, hint)
    return True
