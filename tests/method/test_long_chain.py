"""In a long plant flows are compared with those nearby; that says the same as sums of all flows."""

from pathlib import Path

import numpy as np
import pytest

from rulec.algebra.eliminate import Span
from rulec.commands import matrix
from rulec.commands.matrix import left_out
from rulec.limits import MOST_RULES
from rulec.passes import derive_signatures
from rulec.passes.limits import MOST_SUMMED
from rulec.passes.pipeline import compile_plant, run_passes
from rulec.passes.types import Compilation
from tests.bench.rigs import chain
from tests.conftest import compiled


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


def test_a_fault_keeps_the_rules_that_show_it_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two mixers in series, five dosing modules each."""
    (tmp_path / "plant.yaml").write_text(chain(12), encoding="utf-8")
    whole = compile_plant(tmp_path)
    most = max(len(cells) for cells in whole.cells_of_fault.values())
    assert 5 < most <= MOST_RULES
    assert not left_out(compiled("abc"))
    monkeypatch.setattr(derive_signatures, "MOST_RULES", 5)
    monkeypatch.setattr(matrix, "MOST_RULES", 5)
    few = compile_plant(tmp_path)
    assert "the 5 residuals that tell it first" in left_out(few)
    assert left_out(few) in matrix.matrix_page(few)
    for fault in whole.faults:
        cells, kept = whole.cells_of_fault[fault.id], few.cells_of_fault[fault.id]
        assert kept == tuple(c for c in cells if c in kept)
        assert len(kept) == min(len(cells), 5)
        left = [c.detectable for c in cells if c not in kept]
        assert max((c.detectable for c in kept), default=0.0) <= min(left, default=np.inf)
