"""Refuse equations that become too long or too deep when definitions are written out.

Ten definitions that each use the previous one twice are short to write, but expand to thousands of
terms. So terms and levels are counted first, and an equation that would become too long is refused
before anything is built.
"""

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rulec.knowledge.limits import MAX_COUNTED_TERMS, MAX_LAW_WORK, MAX_WORK, MAX_WRITTEN_DEPTH
from rulec.language.expression import Expression, fold
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader


@dataclass(frozen=True)
class Length:
    """An equation written out: its `terms`, the `depth` of operations inside one another, and the
    `steep` ones of these, all but sums: each multiplies the terms of a derivative."""

    terms: int
    steep: int
    depth: int

    @property
    def work(self) -> int:
        """Effort of differentiating twice: slopes by every name are built, bends by few names.

        Within a factor of two of the terms that the rules of differentiation give, for chains of
        seventeen kinds of equation.
        """
        return self.terms * self.steep * (5 + self.steep)


def check_lengths(
    reader: Reader,
    definitions: Iterable[tuple[Path_, Expression]],
    equations: Iterable[tuple[Path_, Expression]],
) -> None:
    """Report definitions (in order of use) or equations over them that grow too long.

    The last but one key of its path is the name of a definition.
    """
    lengths: dict[str, Length] = {}
    for path, expression in definitions:
        lengths[str(path[-2])] = length = _length_of(expression, lengths)
        if _is_refused(reader, path, length, MAX_WORK):
            return
    total = 0
    for path, expression in equations:
        length = _length_of(expression, lengths)
        if _is_refused(reader, path, length, MAX_WORK - total):
            return
        total += length.work


def check_law(reader: Reader, path: Path_, law: Expression) -> bool:
    """Whether the law of a fault is short enough; otherwise a mistake is reported."""
    return not _is_refused(reader, path, _length_of(law, {}), MAX_LAW_WORK)


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


def _length_of(expression: Expression, lengths: Mapping[str, Length]) -> Length:
    """Length of an equation, given those of the definitions it uses; other names count as 1."""

    def leaf(node: ast.expr) -> Length:
        return lengths.get(node.id, _ONE) if isinstance(node, ast.Name) else _ONE

    def operation(name: str, _: ast.expr, parts: list[Any]) -> Length:
        if name == "neg":
            own: Length = parts[0]
            return own
        each = [part for part in parts if isinstance(part, Length)]  # but the exponent of a power
        return Length(
            min(sum(part.terms for part in each) + (name not in _BINARY), MAX_COUNTED_TERMS),
            max(part.steep for part in each) + (name not in ("add", "sub")),
            max(part.depth for part in each) + 1,
        )

    return fold(expression.tree, leaf, operation)


_BINARY = ("add", "sub", "mul", "div")
_ONE = Length(1, 0, 0)
