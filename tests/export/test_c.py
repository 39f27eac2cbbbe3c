"""Exported C: compiled without a warning, and equal to the plan."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rulec.export.c_printer import header, source
from rulec.export.interpret import run
from rulec.export.module_code import code_of
from rulec.export.program import Apply, Name, Number, Routine, Section, Statement, Variable
from rulec.export.st_printer import blocks
from rulec.export.without_plc import sign, tanh
from tests.conftest import compiled
from tests.export.plants import NO_COMPILER, codes, library
from tests.rig.exported.compiled import COMPILER
from tests.rig.exported.compiled import compiled as compile_c
from tests.rig.exported.reference import differences, expected, inputs_of

MODULES = {
    "abc": ("A", "B", "C"),
    "mixing-rig": ("D", "E"),
    "zema-hydraulic": ("main",),
    "esp-pump": ("pump",),
    "hsy-pumping": ("P11",),
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
def test_standstill_and_odd_readings_are_flagged() -> None:
    """Zero speed, a pressure that leaves nothing under the root, no number, a bad sensor: invalid,
    and still no number that is none."""
    observe = codes("abc")[0].routines[0]
    usual = {v.name: 1e-3 if v.id.startswith("noise:") else True for v in observe.inputs}
    usual |= {"n": 900.0, "dp": 1.8, "P_el": 150.0, "C_dp": 0.4}
    for change, invalid in (
        ({}, ()),
        ({"n": 0.0}, ("pump", "power")),
        ({"dp": 0.41}, ("plant",)),  # less than what is lost downstream, and k0
        ({"dp": float("nan")}, ("pump", "power", "plant")),
        ({"C_dp": float("inf")}, ("plant",)),
        ({"P_el_good": False}, ("power",)),
        ({"P_el": -1e9}, ("power",)),
    ):
        found = library("abc", MODULES["abc"]).run(observe, usual | change)
        wrong = {n for n in ("pump", "power", "plant") if not found[f"{n}_valid"][0]}
        assert set(invalid) == wrong, change
        assert all(np.isfinite(values).all() for values in found.values()), change


@needs_compiler
def test_a_degree_at_the_end_of_its_range_traps_nothing() -> None:
    """A reading that is 100 % low divides by zero: flagged, and finite."""
    undo = codes("abc")[0].routines[1]
    values = {v.name: True if v.kind == "bool" else 0.0 for v in undo.inputs}
    values |= {"n": 900.0, "dp": 1.8, "P_el": 150.0, "C_dp": 0.4, "x_dp_low": 1.0}
    found = library("abc", MODULES["abc"]).run(undo, values)
    assert not any(found[f"{n}_valid"][0] for n in ("pump", "power", "plant"))
    assert all(np.isfinite(v).all() for v in found.values())


def test_files_are_plain() -> None:
    """ASCII, no line too long, no memory of its own, no state."""
    for code in codes("abc"):
        text = header(code) + source(code)
        assert text.isascii()
        assert max(map(len, text.splitlines())) < 110
        assert not any(word in text for word in ("malloc(", "static ", "goto ", "NAN"))


def test_the_head_says_where_it_is_from() -> None:
    """Module, type, digest of the ruleset, and each equation with its source."""
    head = source(codes("abc")[0])[:1500]
    ruleset = compiled("abc")
    for text in ("Module A", "dosing-pcp.yaml", ruleset.sources, "A.pump = Q_geo", "Eq. 1"):
        assert text in head


@needs_compiler
def test_words_of_a_ruleset_stay_in_their_comments(tmp_path: Path) -> None:
    """A ruleset may come from anywhere, and its texts stand at the top of the files."""
    odd = "x */ #error /* ???/ \n\\ (* y *) END_FUNCTION_BLOCK"
    ruleset = replace(compiled("abc"), modules={"C": odd}, title=odd)
    (code,) = code_of(ruleset)
    assert len(compile_c((code,), tmp_path).modules) == 2
    head = blocks(code).partition("FUNCTION_BLOCK C_observe")[0]
    assert head.count("(*") == head.count("*)") == 2


@pytest.mark.parametrize("x", [-30.0, -1.0, -0.05, -1e-3, 0.0, 1e-9, 0.049, 0.051, 0.7, 400.0])
def test_what_no_plc_has_is_calculated(x: float) -> None:
    """Sign and hyperbolic tangent by other operations."""
    name = Name("x")
    size = Apply("abs", (name,))
    fall = Apply("exp", (Apply("mul", (Number(-2.0), size)),))
    statements = (Statement("a", sign(name)), Statement("b", tanh(name, size, fall)))
    real = [Variable(n, n, "real", "", "") for n in ("x", "a", "b")]
    routine = Routine(
        name="f",
        text="",
        inputs=(real[0],),
        parameters=(),
        sections=(Section("", statements),),
        outputs=(real[1], real[2]),
    )
    found = run(routine, {"x": x})
    assert np.sign(x) == found["a"]
    assert pytest.approx(np.tanh(x), rel=1e-13, abs=0) == found["b"]
