"""Exported structured text: it keeps to the grammar, and its tree gives what the plan gives."""

from __future__ import annotations

import numpy as np
import pytest

from rulec.export.st_printer import blocks
from tests.conftest import compiled
from tests.export.plants import codes
from tests.rig.exported.parsed import parsed
from tests.rig.exported.reference import differences, expected, inputs_of

EQUAL = 1e-12
N = 1500


@pytest.mark.parametrize(
    ("plant", "module"),
    [
        ("abc", "C"),
        ("wastewater-lab", "pump1"),
        pytest.param("abc", "A", marks=pytest.mark.prove),
        pytest.param("mixing-rig", "E", marks=pytest.mark.prove),
        pytest.param("zema-hydraulic", "main", marks=pytest.mark.prove),
        pytest.param("hsy-pumping", "P11", marks=pytest.mark.prove),
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
        outputs = block.run(values)
        named = {v.name: np.broadcast_to(outputs[v.name.lower()], (N,)) for v in routine.outputs}
        gap, flags, compared = differences(routine, named, expected(routine, ruleset, values))
        assert gap < EQUAL
        assert 0 == flags
        assert compared > N
