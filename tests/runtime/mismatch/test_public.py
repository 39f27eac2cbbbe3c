"""What is told of a model is what anybody finds who simulates the plant that was written; and the
table of what the three models predict, with the spans that were held out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rulec.effects.write_plant import trial
from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.written_plant import row_errors, simulated, written
from rulec.mismatch.evidence.steady.repaired_model import _ranges
from rulec.mismatch.evidence.stores.fit import plain_end
from rulec.mismatch.inference.prove import course_of, heldout_spans, series_csv
from rulec.mismatch.result import Course, Series
from tests.runtime.mismatch.dynamic.benches import bench, explained, made, tanks
from tests.runtime.mismatch.made import changed, columns
from tests.runtime.mismatches import CANNOT_JUDGE, NAMED

NAN = float("nan")
THREE = np.array([0.0, 1.0, 2.0])
ZERO = 1.0
"""V by which the level reading is off: twenty times its class."""


def test_a_zero_beyond_its_class_does_not_flatter_the_shipped_plant() -> None:
    """Whoever simulates the plant meets the zero; the analysis may let it float. Where plants store
    no residual is solved; errors follow from the table all the same."""
    clean = made(n=512, seed=4)
    off = np.clip(clean.values["lower.y"] + ZERO, 0.0, 10.0)
    recording = changed(clean, {"lower.y": off})
    place, (rules, builder) = bench(recording), tanks()
    ends, plain = plain_end(place, {})
    said = explained(recording, place, ends, plain, plain)
    proofs = said.proofs(())
    refits, shown = written(said, proofs)
    assert shown.plants is not None
    held = shown.fits[0].heldout
    spans = heldout_spans(place.record.time, ~place.record.open)
    repaired = trial(builder, refits.repairs[0])
    for ruleset, error in ((rules, held.shipped), (repaired, held.recalibrated)):
        found = row_errors(ruleset, simulated(ruleset, recording), recording, spans)
        assert found["lower.y"][0] == pytest.approx(error, rel=1e-9)
    (reading,) = said.readings(None, refits, proofs)
    course = course_of(rules.signal_by_id["lower.y"], reading.measured, reading.predicted)
    series = Series(place.record.time, ~place.record.open, (course,))
    table = columns(replace(NAMED, series=series))
    error = table["lower.y recalibrated [V]"] - table["lower.y measured [V]"]
    rms = np.sqrt(np.nanmean(error[table["heldout [1]"] == 1] ** 2))
    assert pytest.approx(reading.fit.heldout.recalibrated, rel=1e-4) == rms
    assert reading.fit.relation is None


def test_a_cell_without_value_is_empty() -> None:
    """Columns in the agreed order, each with its unit. Without a split there is a head."""
    own = {"measured": np.array([1.0, NAN, 3.0]), "repaired": np.array([NAN, 1, 2])}
    course = Course(signal="A.Q", unit="l/h", shipped=THREE, recalibrated=THREE, **own)
    table = series_csv(Series(THREE, np.array([False, True, False]), (course,)))
    assert [
        "time [s],heldout [1],A.Q measured [l/h],A.Q shipped [l/h],A.Q recalibrated [l/h],"
        "A.Q repaired [l/h]",
        "0,0,1,0,0,",
        "1,1,,1,1,1",
        "2,0,3,2,2,2",
    ] == table.splitlines()
    assert "time [s],heldout [1]\n" == series_csv(CANNOT_JUDGE.series)
    assert [] == mismatch_form(CANNOT_JUDGE, "x")["split"]["heldout"]


def test_ends_belong_to_their_spans() -> None:
    """A sample at either end, one sample alone, none, all; as in the machine form."""
    assert [(-0.5, 0.5), (1.5, 2.5)] == heldout_spans(THREE, [True, False, True])
    assert [] == heldout_spans(THREE, [False] * 3)
    assert [(4.0, 4.0)] == heldout_spans(np.array([4.0]), [True])
    found = replace(NAMED, series=Series(THREE, np.array([False, True, True])))
    assert [[0.5, 2.5]] == mismatch_form(found, "x")["split"]["heldout"]


def test_a_range_grows_only_where_a_relation_was_tested() -> None:
    """Behind a closed valve a flow meter shows nothing: no relation judges the pump there."""
    dp = np.array([100.0, 120.0, 140.0, 160.0, 190.0])
    flows = np.array([[9.0, 8.8, 8.6, 8.4, 8.1], [9.0, 8.8, 8.6, 8.4, 0.0], [9, 8.8, 8.6, 8.4, 5]])
    valid = np.array([[True] * 5, [True, True, True, True, False], [True] * 5])
    names = ("m.pump", "m.flow", "m.power")
    observers = [
        SimpleNamespace(id="m.pump", module="m", signals=("m.dp",)),
        SimpleNamespace(id="m.flow", module="m", signals=("m.Q",)),
        SimpleNamespace(id="m.power", module="m", signals=("m.dp", "m.P")),
    ]

    def relation(*ids: str) -> SimpleNamespace:
        terms = [SimpleNamespace(observer=o, sign=s) for o, s in zip(ids, (1.0, -1.0), strict=True)]
        return SimpleNamespace(terms=terms)

    system = SimpleNamespace(
        ruleset=SimpleNamespace(
            residuals=[relation("m.pump", "m.flow"), relation("m.power", "m.pump")]
        ),
        number={n: i for i, n in enumerate(names)},
        flows=lambda setting: SimpleNamespace(values=flows),
        valid=valid,
        observers=observers,
        data=SimpleNamespace(values={"m.dp": dp, "m.T": dp + 1.0, "m.x": dp}),
    )
    law = SimpleNamespace(module="m", drivers={"T": "m.T"})
    plan = SimpleNamespace(
        select=lambda names: SimpleNamespace(used_inputs=() if "q:m.flow" in names else ("m.C",))
    )
    system.builder = SimpleNamespace(plan=lambda module, joined: plan)
    system.data.values["m.Q"] = dp + 2.0
    system.ruleset.signal_by_id = dict.fromkeys(system.data.values)
    settled: Any = SimpleNamespace(
        rows=SimpleNamespace(system=system),
        setting=SimpleNamespace(joined=[law], ids=("law",)),
        prior=SimpleNamespace(names=("m.C",)),
        used=np.ones(5, dtype=bool),
    )
    assert {"m.dp": (100.0, 160.0), "m.T": (101.0, 161.0)} == _ranges(settled)
