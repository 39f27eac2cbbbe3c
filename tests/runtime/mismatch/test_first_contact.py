"""First contact: a data sheet, ordinary operation, and nothing told that nobody would believe."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.evidence.failing_sensors import impossible
from rulec.mismatch.result import Mismatch
from tests.conftest import ROOT
from tests.runtime.mismatch.dynamic.benches import made, tanks
from tests.runtime.mismatch.made import alone, changed, compared, recorded, tour, warming

PUMP = """\
plant: metered
title: A pump by its sheet, with no line behind it
modules:
  A:
    type: metered-centrifugal
    parameters:
      h0: {value: 1.111, u: 0.01, unit: bar, source: data sheet}
      h1: {value: 1.142e-4, u: 1.0e-5, unit: bar/(l/h), source: data sheet}
      h2: {value: 3.04e-7, u: 1.0e-8, unit: bar/(l/h)**2, source: data sheet}
      p0: {value: 28.245, u: 0.5, unit: W, source: data sheet}
      p1: {value: 0.03228, u: 0.001, unit: W/(l/h), source: data sheet}
      p2: {value: 8.453e-6, u: 5.0e-7, unit: W/(l/h)**2, source: data sheet}
connections: []
"""


def shifted(there: tuple[Ruleset, ModelBuilder], signal: str, by: float) -> Mismatch:
    given = {**tour(there[0], 144), "A.T": warming(144)}
    recording = recorded(there, given)
    return compared(there, changed(recording, {signal: recording.values[signal] + by}))


def test_power_that_no_law_says_has_no_tick() -> None:
    """Within its belief `P0` would have to be 44 W, sheet 25 +- 0.5: nobody believes that."""
    found = shifted(alone(), "A.P_el", 25.0)
    assert found.verdict not in ("none", "cannot judge")
    assert found.strain or found.findings
    assert "Nothing to do" not in found.next


def test_a_pressure_reading_with_a_zero_error_is_told_as_that(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "kb", tmp_path / "kb")
    (tmp_path / "plant.yaml").write_text(PUMP, encoding="utf-8")
    found = shifted(open_builder(tmp_path), "A.dp", 0.15e5)
    assert [f.id for f in found.findings] == ["A.offset-pressure@dp"]
    assert not any("check valve" in f.title for f in found.findings)


def test_a_power_below_zero_is_a_sensor_that_is_wrong() -> None:
    """With swapped wires a power meter reads less than nothing: that was "no mismatch" once."""
    found = shifted(alone(), "A.P_el", -2000.0)
    (finding,) = found.findings
    assert "sensor" == found.verdict
    assert ("impossible-reading", "A", "P_el") == (finding.name, finding.module, finding.place)
    assert "144 of 144 readings lie outside of 0 to" in finding.text
    assert [("A", "P_el")] == [(p.module, p.place) for p in found.locations]


def test_most_readings_must_be_out_of_range() -> None:
    """A few are left out, like single readings that jump. Plants that store are asked too."""
    recording = recorded(alone(), tour(alone()[0], 120))
    for share, told in ((0.0, 0), (0.4, 0), (0.6, 1)):
        off = np.where(np.arange(120) < share * 120, 2000.0, 0.0)
        wrong = changed(recording, {"A.P_el": recording.values["A.P_el"] - off})
        assert told == len(list(impossible(wrong, alone()[0])))
    level = made(200)
    assert not list(impossible(level, tanks()[0]))
    high = changed(level, {"lower.y": np.full(200, 14.0)})
    assert ["lower.y.impossible-reading"] == [f.id for f in impossible(high, tanks()[0])]
