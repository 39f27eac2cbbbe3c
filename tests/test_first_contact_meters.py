"""A pipeline with a meter and a gauge at both ends, at five flows: what nobody would believe is not
told."""

from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main
from tests.conftest import Capsys
from tests.written import json_of, write_columns, write_plant

TYPE = """\
module: pipeline
version: 1
title: Pipeline with meters and gauges at both ends
signals:
  p1: {quantity: pressure difference, unit: MPa, sensor: process-pressure,
        range: [0, 1.6], reference: 0.56}
  p2: {quantity: pressure difference, unit: MPa, sensor: process-pressure,
        range: [0, 1.6], reference: 0.555}
  Q1: {quantity: volume flow, unit: m3/h, sensor: magnetic-inductive,
        range: [0, 5], reference: 1.44}
  Q2: {quantity: volume flow, unit: m3/h, sensor: magnetic-inductive,
        range: [0, 5], reference: 1.39}
parameters:
  k:  {value: 0.0026, unit: MPa/(m3/h)**2, u: 0.001, source: "[assumed]"}
  k0: {value: 0, unit: MPa, u: 0.005, sign: any, source: "[assumed]"}
definitions:
  loss: {is: p1 - p2 - k0}
observers:
  inlet:  {component: line, Q: Q1, reference: true, source: meter}
  outlet: {component: line, Q: Q2, source: meter}
  resis:  {component: line, Q: sqrt(loss/k), accuracy: "5 %, [assumed]", source: Darcy}
faults: [slope(Q1), slope(Q2), offset(Q1), offset(Q2), clogging(loss)]
"""


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    folder = write_plant(tmp_path / "line", {"pipe": "pipeline"})
    modules = folder / "kb" / "modules"
    modules.mkdir(parents=True)
    (modules / "pipeline.yaml").write_text(TYPE, encoding="utf-8")
    return folder


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """One meter shows 3 % less to 5 % more than the other; the loss hardly moves with the flow."""
    random = np.random.default_rng(3)
    flow, other, inlet = (
        np.tile(np.repeat(values, 40), 5)
        for values in (
            (0.803, 1.169, 1.440, 1.648, 1.833),
            (0.826, 1.150, 1.392, 1.573, 1.737),
            (0.181, 0.3725, 0.562, 0.749, 0.935),
        )
    )
    noise = random.standard_normal((4, len(flow)))
    columns = {
        "t [s]": np.arange(len(flow)),
        "pipe.p1 [MPa]": np.round(inlet + 5e-4 * noise[0], 3),
        "pipe.p2 [MPa]": np.round(inlet - 0.0053 + 5e-4 * noise[1], 3),
        "pipe.Q1 [m3/h]": flow + 0.002 * noise[2],
        "pipe.Q2 [m3/h]": other + 0.01 * noise[3],
    }
    return write_columns(tmp_path / "states.csv", columns)


def test_columns_in_right_units_are_not_read_in_others(plant: Path, recording: Path) -> None:
    """At zero, or beside an estimate that says nothing, any two estimates agree."""
    found = json_of("diagnose", plant, recording)
    assert {"fault"} == {finding["kind"] for finding in found["findings"]}


def test_either_of_two_meters_may_be_wrong(plant: Path, recording: Path) -> None:
    """Also where no one degree fits all stretches: the probabilities add up."""
    found = json_of("diagnose", plant, recording)
    for finding in found["findings"]:
        named = [finding, *finding["alternatives"], *finding["remote"]]
        assert {"pipe.Q1", "pipe.Q2"} == {one["fault"][:7] for one in named}
        assert 1.0 == pytest.approx(sum(one["probability"] for one in named), abs=0.05)
    assert found["findings"]


def test_a_law_without_a_value_is_not_calibrated(
    plant: Path, recording: Path, tmp_path: Path, capsys: Capsys
) -> None:
    assert 1 == main(["calibrate", str(plant), str(recording), "-o", str(tmp_path / "c.yaml")])
    assert (
        "pipe.resis: with the values that fit best the law has no value" in capsys.readouterr().err
    )
