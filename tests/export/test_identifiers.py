"""Names in exported code."""

from __future__ import annotations

import pytest

from rulec.export.identifiers import RESERVED, Identifiers
from rulec.export.limits import LONGEST_IDENTIFIER
from tests.export.plants import codes


def test_names_are_legal_and_differ() -> None:
    """Whatever the words: letters, digits, single underscores, short, no reserved word."""
    names = Identifiers()
    words = [
        "a" * 50,
        "a" * 51,
        "A" * 50,
        "",
        *["int", "INT", "x__y_", "_x", "3", "größe", "in", "IF"],
    ]
    made = [names.new(word) for word in words]
    assert len(made) == len({name.lower() for name in made})
    for name in made:
        assert name.isascii()
        assert name.isidentifier()
        assert "__" not in name
        assert not name.startswith("_")
        assert not name.endswith("_")
        assert len(name) <= LONGEST_IDENTIFIER
        assert name.lower() not in RESERVED


@pytest.mark.parametrize("plant", ["abc", "mixing-rig", "hsy-pumping"])
def test_no_name_stands_for_two_things(plant: str) -> None:
    """In a language that knows no case."""
    for code in codes(plant):
        for routine in code.routines:
            names = [v.name for v in routine.inputs]
            names += [p.name for p in routine.parameters]
            names += [s.name for s in routine.statements]
            assert len(names) == len({n.lower() for n in names})
            assert {v.name for v in routine.outputs} <= set(names)
            assert not RESERVED & {n.lower() for n in names}
