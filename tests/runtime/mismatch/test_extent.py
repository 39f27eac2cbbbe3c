"""Sizes of readings whose zero is arbitrary: no answer depends on how far zero lies away."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from rulec.effects.model_builder import open_builder
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.sizes import span
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
CELSIUS = {"unit": "degC", "inlet": "15", "outlet": "24.5", "range": "[0, 150]"}
KELVIN = {"unit": "K", "inlet": "288.15", "outlet": "297.65", "range": "[273.15, 423.15]"}


def heated(folder: Path, words: dict[str, str]) -> Rows:
    """A flow heater at several powers and flows."""
    shutil.copytree(ROOT / "kb", folder / "kb")
    (folder / "kb" / "modules" / "heater.yaml").write_text(HEATER.format(**words))
    text = "plant: heated\ntitle: A heater\nmodules: {A: {type: heater}}\nconnections: []\n"
    (folder / "plant.yaml").write_text(text)
    opened = open_builder(folder)
    number = np.arange(240) // 12
    given = {
        "A.P": 40e3 * (0.8 + 0.02 * number),
        "A.v": 15.0 * (0.8 + 0.4 * np.mod(number * np.sqrt(2.0), 1.0)),
        "A.T_i": np.full(240, 288.15),
    }
    return rows_at(opened, recorded(opened, given))


@pytest.fixture(scope="module", params=[CELSIUS, KELVIN], ids=["degC", "K"])
def rows(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Rows:
    return heated(tmp_path_factory.mktemp("heater"), request.param)


def test_a_temperature_spans_its_range(rows: Rows) -> None:
    """Where no range is stated, what it showed counts."""
    assert span(rows.system, "A.T_o") == pytest.approx(150.0)
    assert span(rows.system, "A.T_i") < 1.0


def test_an_offset_of_a_thermometer_is_usual_as_a_share_of_its_range(rows: Rows) -> None:
    """The entry says 5 %; half of all offsets are below."""
    candidate = next(c for c in rows.system.candidates if c.name == "offset")
    (unknown,) = candidate.unknowns
    size = Geometry(rows).size(candidate, unknown)
    assert unknown.usual is not None
    assert unknown.usual.of_place
    assert size.scale * t.ppf(0.75, size.freedom) == pytest.approx(0.05 * 150.0)
