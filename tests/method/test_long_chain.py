"""In a long plant flows are compared with those nearby; that says the same as sums of all flows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rulec
from rulec.algebra.span import Span
from rulec.commands import matrix_page
from rulec.commands.matrix_page import left_out
from rulec.limits import MOST_RULES
from rulec.passes import derive_residuals, derive_signatures
from rulec.passes.limits import MOST_SUMMED
from rulec.passes.pipeline import compile_plant, run_passes
from rulec.passes.types import Compilation
from tests.bench.rigs import chain
from tests.conftest import compiled

LEAK = "D0_1.leakage"


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    """Two mixers in series, five dosing modules each."""
    (tmp_path / "plant.yaml").write_text(chain(12), encoding="utf-8")
    return tmp_path


def test_long_sums_follow_from_near_ones(tmp_path: Path) -> None:
    """Every comparison of a sum of all flows upstream is a sum of residuals, none is lost."""
    (tmp_path / "plant.yaml").write_text(chain(60), encoding="utf-8")
    known = run_passes(Compilation(path=tmp_path), "residuals")
    assert max(len(r.terms) for r in known.residuals) <= MOST_SUMMED + 1
    assert max(len(flow.terms) for flow in known.network.sums.values()) == 50
    number = {name: i for i, name in enumerate(known.plant.observers)}
    span = Span()
    for residual in known.residuals:
        span.add({number[o]: sign for sign, o in residual.terms})
    for (module, kind), flow in known.network.sums.items():
        for own in known.plant.modules[module].type.observers:
            terms = {number[f"{m}.{kind}"]: sign for m, sign in flow.terms.items()}
            assert span.holds({**terms, number[f"{module}.{own}"]: -1}), (module, kind)


def test_a_fault_is_found_as_by_long_sums(plant: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = compile_plant(plant)
    monkeypatch.setattr(derive_residuals, "MOST_SUMMED", 6)
    near = compile_plant(plant)
    assert len(near.residuals) < len(whole.residuals)
    assert len(near.cells) < len(whole.cells)
    inputs = {f"{s.id} [{s.unit}]": np.full(60, s.shown(s.reference)) for s in whole.signals}
    inputs["time [s]"] = np.arange(60.0)
    found = []
    for ruleset in (whole, near):
        given = rulec.CompileResult(path=plant, ruleset=ruleset)
        recording = rulec.simulate(given, inputs, faults=[f"{LEAK}=0.3"], noise=1).columns()
        (finding,) = rulec.diagnose(given, recording).findings
        found.append((finding.fault.id, finding.degree, finding.lower, finding.upper))
    assert found[0][0] == found[1][0] == LEAK
    assert found[0][1:] == pytest.approx(found[1][1:], rel=1e-3)


def test_a_fault_keeps_the_rules_that_show_it_first(
    plant: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = compile_plant(plant)
    most = max(len(cells) for cells in whole.cells_of_fault.values())
    assert 5 < most <= MOST_RULES
    assert not left_out(compiled("abc"))
    monkeypatch.setattr(derive_signatures, "MOST_RULES", 5)
    monkeypatch.setattr(matrix_page, "MOST_RULES", 5)
    few = compile_plant(plant)
    assert "the 5 residuals that tell it first" in left_out(few)
    assert left_out(few) in matrix_page.matrix_page(few)
    for fault in whole.faults:
        cells, kept = whole.cells_of_fault[fault.id], few.cells_of_fault[fault.id]
        assert kept == tuple(c for c in cells if c in kept)
        assert len(kept) == min(len(cells), 5)
        left = [c.detectable for c in cells if c not in kept]
        assert max((c.detectable for c in kept), default=0.0) <= min(left, default=np.inf)
