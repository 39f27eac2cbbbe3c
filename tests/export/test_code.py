"""Exported C and structured text: compiled or parsed without a warning, and equal to the plan."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import KnowledgeSpec

from rulec.export.c_printer import header, source
from rulec.export.identifiers import RESERVED, Identifiers
from rulec.export.limits import LONGEST_IDENTIFIER
from rulec.export.module_code import code_of
from rulec.export.st_printer import blocks
from tests.conftest import compiled
from tests.export.plants import NO_COMPILER, codes, library
from tests.rig.exported.parsed import differences, expected, inputs_of, parsed
from tests.rig.exported.split import COMPILER
from tests.rig.exported.split import compiled as compile_c

MODULES = {
    "abc": ("A", "B", "C"),
    "mixing-rig": ("D", "E"),
    "zema-hydraulic": ("main",),
    "esp-pump": ("pump",),
}
"""Of each type one."""

EQUAL = 1e-12
needs_compiler = pytest.mark.skipif(COMPILER is None, reason=NO_COMPILER)


@needs_compiler
@pytest.mark.parametrize("plant", MODULES)
def test_c_is_the_plan(plant: str) -> None:
    """On random readings: usual, at zero, negative, out of range, missing, no numbers at all."""
    ruleset = compiled(plant)
    chosen = [code for code in codes(plant) if code.module in MODULES[plant]]
    for code in chosen:
        for routine in code.routines:
            values = inputs_of(routine, ruleset, n=1500, seed=3)
            found = library(plant, MODULES[plant]).run(routine, values)
            gap, flags, compared = differences(routine, found, expected(routine, ruleset, values))
            assert gap < EQUAL, (code.module, routine.name)
            assert 0 == flags, (code.module, routine.name)
            assert compared > 1500
            for v in routine.outputs:
                assert np.isfinite(found[v.name]).all(), v.id


@needs_compiler
def test_a_division_by_zero_is_flagged() -> None:
    """Of a reading that is 100 % low; still no number that is none."""
    undo = codes("abc")[0].routines[1]
    values = {v.name: True if v.kind == "bool" else 0.0 for v in undo.inputs}
    values |= {"n": 900.0, "dp": 1.8, "P_el": 150.0, "C_dp": 0.4, "x_dp_low": 1.0}
    found = library("abc", MODULES["abc"]).run(undo, values)
    assert not any(found[f"{n}_valid"][0] for n in ("pump", "power", "plant"))
    assert all(np.isfinite(v).all() for v in found.values())


def test_files_are_plain_and_say_where_they_are_from() -> None:
    """ASCII, no line too long, no memory of its own, no state; module, type, digest of the ruleset,
    the maker's version, each equation with its source."""
    kb = KnowledgeSpec(name="acme-pumps", version="1.2", digest="d0d0")
    ruleset = replace(compiled("abc"), knowledge=(kb,))
    code = code_of(ruleset)[0]
    text = header(code) + source(code)
    assert text.isascii()
    assert max(map(len, text.splitlines())) < 110
    assert not any(word in text for word in ("malloc(", "static ", "goto ", "NAN"))
    for part in ("Module A", "dosing-pcp.yaml", ruleset.sources, "A.pump = Q_geo", "Eq. 1"):
        assert part in source(code)[:1500]
    assert "acme-pumps 1.2 d0d0" in source(code)[:1500]


@needs_compiler
def test_words_of_a_ruleset_stay_in_their_comments(tmp_path: Path) -> None:
    """A ruleset may come from anywhere, and its texts stand at the top of the files."""
    odd = "x */ #error /* ???/ \n\\ (* y *) END_FUNCTION_BLOCK"
    ruleset = replace(compiled("abc"), modules={"C": odd}, title=odd)
    (code,) = code_of(ruleset)
    assert len(compile_c((code,), tmp_path).modules) == 2
    head = blocks(code).partition("FUNCTION_BLOCK C_observe")[0]
    assert head.count("(*") == head.count("*)") == 2


def test_names_are_legal_and_differ() -> None:
    """Whatever the words, in a language that knows no case: letters, digits, single underscores,
    short, no reserved word."""
    names = Identifiers()
    odd = ("a" * 50, "a" * 51, "A" * 50, "", "int", "INT", "x__y_", "_x", "3", "größe", "in", "IF")
    made = [names.new(word) for word in odd]
    assert len(made) == len({name.lower() for name in made})
    for name in made:
        assert re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name)
        assert len(name) <= LONGEST_IDENTIFIER
        assert name.lower() not in RESERVED
    for routine in (routine for code in codes("mixing-rig") for routine in code.routines):
        parts = (*routine.inputs, *routine.parameters, *routine.statements)
        lower = [part.name.lower() for part in parts]
        assert len(lower) == len(set(lower))
        assert not RESERVED & set(lower)


N = 1500


SLOW = (("abc", "A"), ("mixing-rig", "E"), ("zema-hydraulic", "main"), ("hsy-pumping", "P11"))


@pytest.mark.parametrize(
    ("plant", "module"),
    [
        ("abc", "C"),
        ("wastewater-lab", "pump1"),
        *(pytest.param(*one, marks=pytest.mark.prove) for one in SLOW),
    ],
)
def test_structured_text_is_the_plan(plant: str, module: str) -> None:
    """Parse the blocks of a module and run them; the parser is slow, so large ones are proved."""
    ruleset = compiled(plant)
    (code,) = (c for c in codes(plant) if c.module == module)
    text = blocks(code)
    assert text.isascii()
    found = parsed(text)
    assert {f"{code.name}_observe", f"{code.name}_undo"} == found.keys()
    for routine in code.routines:
        values = inputs_of(routine, ruleset, N, seed=5)
        block = found[f"{code.name}_{routine.name}"]
        assert {v.name.lower() for v in routine.inputs} == block.declared["inputs"].keys()
        named = block.outputs(routine, values)
        gap, flags, compared = differences(routine, named, expected(routine, ruleset, values))
        assert gap < EQUAL
        assert 0 == flags
        assert compared > N
