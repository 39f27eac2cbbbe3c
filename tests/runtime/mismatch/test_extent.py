"""Sizes of readings whose zero is arbitrary: no answer depends on how far zero lies away."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from rulec.effects.model_builder import open_builder
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence, span
from tests.conftest import ROOT
from tests.runtime.mismatch.made import recorded, rows_at

HEATER = """\
module: heater
version: 1
title: Flow heater
signals:
  Q:   {{quantity: volume flow, unit: l/min,
        sensor: magnetic-inductive, range: [0, 200], reference: 60}}
  P:   {{quantity: electric power, unit: kW, sensor: converter-power, input: true, reference: 40}}
  v:   {{quantity: rotational speed, unit: rpm,
        sensor: converter-speed, input: true, reference: 900}}
  T_i: {{quantity: temperature, unit: {unit},
        sensor: resistance-thermometer, input: true, reference: {inlet}}}
  T_o: {{quantity: temperature, unit: {unit},
        sensor: resistance-thermometer, range: {range}, reference: {outlet}}}
parameters:
  c: {{value: 4.18e6, unit: J/m3/K, u: 1.0e4, title: heat capacity, source: data sheet}}
  V: {{value: 66.7, unit: ml/rev, u: 0.5, title: displacement, source: data sheet}}
observers:
  meter: {{component: pump, Q: Q, reference: true, source: flow meter}}
  pump:  {{component: pump, Q: v*V, source: displacement}}
  heat:  {{component: line, Q: P/(c*(T_o - T_i)), source: heat balance}}
faults: [offset(T_o)]
"""
PLANT = "plant: heated\ntitle: A heater\nmodules: {A: {type: heater}}\nconnections: []\n"


@pytest.mark.parametrize("zero", [0.0, 273.15])
def test_a_temperature_spans_its_range(tmp_path: Path, zero: float) -> None:
    """Where no range is stated, what it showed counts. An offset is usual as a share of the range:
    the entry says 5 %; half of all offsets are below."""
    stated = {"inlet": zero + 15.0, "outlet": zero + 24.5, "range": [zero, zero + 150.0]}
    text = HEATER.format(unit="K" if zero else "degC", **stated)
    shutil.copytree(ROOT / "kb", tmp_path / "kb")
    (tmp_path / "kb" / "modules" / "heater.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "plant.yaml").write_text(PLANT, encoding="utf-8")
    opened, number = open_builder(tmp_path), np.arange(240) // 12
    given = {
        "A.P": 40e3 * (0.8 + 0.02 * number),
        "A.v": 15.0 * (0.8 + 0.4 * np.mod(number * np.sqrt(2.0), 1.0)),
        "A.T_i": np.full(240, 288.15),
    }
    rows = rows_at(opened, recorded(opened, given))
    assert span(rows.system, "A.T_o") == pytest.approx(150.0)
    assert span(rows.system, "A.T_i") < 1.0
    candidate = next(c for c in rows.system.candidates if c.name == "offset")
    (unknown,) = candidate.unknowns
    assert unknown.usual is not None
    assert unknown.usual.of_place
    size = SteadyEvidence(rows).size(candidate, unknown)
    assert size.scale * t.ppf(0.75, size.freedom) == pytest.approx(0.05 * 150.0)
