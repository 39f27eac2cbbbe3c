"""Check the regimes of a module type, each with conditions that must all hold."""

import ast
from collections.abc import Collection, Mapping

from rulec.knowledge.module_type import Comparison, Regime, Signal
from rulec.language.expression import (
    Rejected,
    checked,
    parse,
    rejected_at,
    syntax_tree,
    text_of,
)
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader

MINIMUM = "minimum"
"""In a comparison: the smallest reading at which the equations hold."""


def read_regimes(
    reader: Reader, signals: Mapping[str, Signal], names: Collection[str]
) -> dict[str, Regime]:
    """All regimes of a module document by name; `names` are the names they may use."""
    found = {}
    for name, part in reader.document.data.get("regimes", {}).items():
        path: Path_ = ("regimes", name)
        places = ((*path, "when", i) for i in range(len(part["when"])))
        compared = [_comparison(reader, place, signals, names) for place in places]
        found[name] = Regime(
            name=name,
            title=part["title"],
            when=tuple(c for c in compared if c is not None),
            status=part["status"],
            text=part["text"],
            action=part["action"],
            origin=reader.origin(*path, source=part["source"]),
        )
    return found


def _comparison(
    reader: Reader, path: Path_, signals: Mapping[str, Signal], names: Collection[str]
) -> Comparison | None:
    """A comparison such as ``loss < 0``; a mistake is reported and gives None."""
    text: str = reader.part(path)
    before = len(reader.found)
    try:
        tree = syntax_tree(text, also="<>")
        match tree:
            case ast.Compare(ops=[ast.Gt() | ast.Lt()], left=left, comparators=[right]):
                above = isinstance(tree.ops[0], ast.Gt)
            case _:
                raise rejected_at(tree, "KB041", "this does not compare two values")
        if isinstance(right, ast.Name) and right.id == MINIMUM:
            signal = signals.get(text_of(left))
            if signal is not None and signal.minimum is not None:
                return Comparison(text, parse("0"), signal.name, above)
            message = f"'{text_of(left)}' is no signal of this module with a minimum"
            reader.report(path, "KB126", message, "give the signal a 'minimum'")
            return None
        more, less = (left, right) if above else (right, left)
        margin = checked(ast.copy_location(ast.BinOp(more, ast.Sub(), less), tree))
    except Rejected as error:
        reader.report_error(path, error)
        return None
    what = "signal, parameter nor definition of this module"
    reader.check_names(path, margin, names, what)
    reader.check_own(path, margin, "a regime", "give it a definition")
    return Comparison(text, margin) if len(reader.found) == before else None
