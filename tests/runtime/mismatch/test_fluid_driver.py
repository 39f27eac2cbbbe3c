"""A property of the plant's fluid drives a law where only the fluid's temperature is read."""

import csv
import functools
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import has_drivers, references, screen
from rulec.mismatch.evidence.steady.system import with_properties
from rulec.mismatch.experiment.forecast import Places, data_at
from rulec.mismatch.experiment.plan import planned
from rulec.mismatch.experiment.result import inputs_csv
from rulec.mismatch.result import CandidateSet
from tests.conftest import ROOT
from tests.runtime.mismatch.made import recorded, rows_at, tour, warming, without

SLIP = "A.slip-viscosity@Q_geo(dp, viscosity(T))"
VISCOSITY = "viscosity(A.T)"
SAMPLES = 240


@functools.cache
def oily() -> tuple[Ruleset, ModelBuilder]:
    return open_builder(Path(__file__).parent / "oily.yaml")


@functools.cache
def recording() -> Recording:
    """Slip in inverse proportion to the viscosity, which nobody reads."""
    rules, builder = oily()
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    usual = float(np.median(builder.fluid_drivers[VISCOSITY].at(given["A.T"])[0]))
    return recorded(oily(), given, {SLIP: {"m": 1.0, "mu0": usual}})


@functools.cache
def planted() -> Rows:
    return rows_at(oily(), recording())


def viscosity(celsius: float) -> float:
    """Of HLP 32 by Walther's equation in its own form, Pa s. Source: ASTM D341."""
    known = np.array([[313.15, 32.0], [373.15, 5.4]])
    double = np.log10(np.log10(known[:, 1] + 0.7))
    slope = (double[1] - double[0]) / np.log10(known[1, 0] / known[0, 0])
    there = double[0] + slope * np.log10((celsius + 273.15) / known[0, 0])
    density = 872.0 * (1.0 - 7.0e-4 * (celsius - 15.0))
    return float(density * (10 ** (10**there) - 0.7) * 1e-6)


def test_a_property_counts_as_a_reading() -> None:
    """Its noise is that of the thermometer; oil below freezing is beyond its equations."""
    given = {**tour(oily()[0], SAMPLES), "A.T": warming(SAMPLES) - 40.0}
    assert VISCOSITY not in rows_at(oily(), recorded(oily(), given)).system.data.values
    data = planted().system.data
    celsius = data.values["A.T"] - 273.15
    expected = [viscosity(t) for t in celsius]
    assert data.values[VISCOSITY] == pytest.approx(expected, rel=1e-9)
    steep = [(viscosity(t - 0.01) - viscosity(t + 0.01)) / 0.02 for t in celsius]
    assert data.noise[VISCOSITY] == pytest.approx(steep * data.noise["A.T"], rel=1e-4)


def standing(name: str, strength: str, value: float) -> CandidateSet:
    """One law, as if a mismatch had left it standing."""
    system = planted().system
    candidate = next(c for c in system.candidates if c.id == name)
    fixed, values = dict(references(system, candidate)), {f"{name}.{strength}": value}
    own: Any = {"joined": (name,), "values": values, "fixed": fixed, "periods": (), "terms": ()}
    return CandidateSet(names=(name,), titles=(name,), probability=0.5, **own)


def test_an_experiment_knows_the_property_where_the_temperature_is_set() -> None:
    """The recipe asks for the temperature, as nobody can set a viscosity."""
    laws = standing(SLIP, "m", 1.0), standing("A.slip-temperature@Q_geo", "b", 0.03)
    found = planned(recording(), *oily(), laws, most=2, seconds=3600.0)
    assert found.steps
    header, *rows = csv.reader(inputs_csv(found, oily()[0]).splitlines())
    assert all(row[header.index("A.T [degC]")] for row in rows)
    assert not any(VISCOSITY in name for name in header)
    data, celsius = planted().system.data, np.array([12.0, 47.0])
    time = data.time[-1] + np.array([1.0, 2.0])
    places = Places({"A.T": celsius + 273.15}, np.array([0, 0]), time)
    there = with_properties(oily()[1], data_at(data, places))
    assert there.values[VISCOSITY] == pytest.approx([viscosity(t) for t in celsius], rel=1e-9)


def test_the_planted_law_is_among_the_best_and_fits_better_than_a_temperature() -> None:
    rows = planted()
    plain = fit(rows, Configuration(), rows.system.data.open)
    trials = {t.candidate.id: t for t in screen(plain, rows.system.candidates)}
    assert SLIP in list(trials)[:3]
    fits = {}
    for name in (SLIP, "A.slip-temperature@Q_geo"):
        found = trials[name]
        there = plain.setting.joining(found.candidate, found.values, found.fixed)
        fits[name] = fit(rows, there, plain.used)
    left = {name: float(np.sum(f.residual**2)) for name, f in fits.items()}
    assert min(left, key=lambda name: left[name]) == SLIP
    exponent = fits[SLIP].setting.values[f"{SLIP}.m"]
    assert abs(exponent - 1.0) < 4.0 * fits[SLIP].u(f"{SLIP}.m")


def test_of_a_property_that_is_read_the_reading_counts(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "plants" / "esp-pump", tmp_path / "plant")
    file = tmp_path / "plant" / "p100.yaml"
    file.write_text(f"{file.read_text()}fluid: glycerol\nkb: {ROOT / 'kb'}\n")
    opened = open_builder(file)
    given = {**tour(opened[0], SAMPLES), "pump.T": warming(SAMPLES)}
    given["pump.mu"] = viscosity(40.0) * (1.0 + np.arange(SAMPLES) / SAMPLES)
    recording = recorded(opened, given, seed=None)
    for shown, driver in (
        (recording, "pump.mu"),
        (without(recording, "pump.mu"), "viscosity(pump.T)"),
    ):
        system = rows_at(opened, shown).system
        every = [c for c in system.candidates if c.name == "head-viscosity"]
        every = [c for c in every if has_drivers(system, c)]
        assert [c.drivers["mu"] for c in every] == [driver]
