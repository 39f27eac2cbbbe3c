"""First contact: a data sheet, ordinary operation, and nothing told that nobody would believe."""

from __future__ import annotations

import shutil
from dataclasses import replace

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.result import Mismatch
from tests.conftest import ROOT
from tests.runtime.mismatch.made import alone, compared, recorded, tour, warming

SAMPLES = 144
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
    """What is told where a reading is off by a constant, SI."""
    given = {**tour(there[0], SAMPLES), "A.T": warming(SAMPLES)}
    made = recorded(there, given)
    return compared(there, replace(made, values={**made.values, signal: made.values[signal] + by}))


@pytest.fixture(scope="module")
def metered(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ruleset, ModelBuilder]:
    folder = tmp_path_factory.mktemp("metered")
    shutil.copytree(ROOT / "kb", folder / "kb")
    (folder / "plant.yaml").write_text(PUMP, encoding="utf-8")
    return open_builder(folder)


@pytest.mark.parametrize("watts", [25.0, 150.0])
def test_power_that_no_law_says_has_no_tick(watts: float) -> None:
    """Within its belief `P0` would have to be 44 W, sheet 25 +- 0.5: nobody believes that."""
    found = shifted(alone(), "A.P_el", watts)
    assert found.verdict not in ("none", "cannot judge")
    assert found.strain or found.findings
    assert "Nothing to do" not in found.next


def test_a_pressure_reading_with_a_zero_error_is_told_as_that(
    metered: tuple[Ruleset, ModelBuilder],
) -> None:
    """There is no line that a check valve could be in."""
    found = shifted(metered, "A.dp", 0.15e5)
    assert [f.id for f in found.findings] == ["A.offset-pressure@dp"]
    assert not any("check valve" in f.title for f in found.findings)
