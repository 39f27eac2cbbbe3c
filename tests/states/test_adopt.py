"""Physics that a plant left out in what it stores, taken over: it predicts as the analysis did."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording_file import read_file

from rulec.cli import main
from rulec.effects.adopt import adoption_of, why_not
from rulec.effects.model_builder import ModelBuilder
from rulec.effects.repair import read_form, repair_of
from rulec.effects.write_plant import plant_files
from rulec.knowledge.module_type import ModuleType
from rulec.knowledge.read import read_plant
from rulec.simulation.predict import predict
from tests.conftest import ROOT
from tests.states.plants import TANKS, random_inputs, write_inputs
from tests.test_adopt import Found, adopted, mismatch, models_of, opened, rules_of

CAUGHT = "upper.overflow-caught@inflow"


TYPICAL = {"h": 0.12, "inflow": 1e-5, "outflow": 1e-5, "u": 3.0, "y": 5.0}
"""Readings, levels and flows of the tanks, SI."""


def unknowns_of(builder: ModelBuilder, name: str) -> dict[str, float]:
    """For each parameter of a candidate its first start, or a typical value of its driver."""
    candidate = next(c for c in builder.candidates if c.id == name)
    return {
        u.name: u.starts[0] if u.starts else TYPICAL[str(u.driver).partition(".")[2]]
        for u in candidate.unknowns
    }


def type_of(plant: Path, module: str) -> ModuleType:
    return models_of(plant).plant.modules[module].type


def assert_same_course(
    folder: Path, new: Path, data: Mapping[str, Any], builder: ModelBuilder
) -> Array:
    """The new plant, read from its files, predicts what the analysis had: to 1e-9 V."""
    repair = data["repair"]
    values = {**builder.parameters.constants}
    values |= dict(zip(repair["parameters"], repair["values"], strict=True))
    values |= {k: v for entry in repair["joined"] for k, v in entry["fixed"].items()}
    balances = builder.balances(tuple(entry["id"] for entry in repair["joined"]))
    time, u = random_inputs(300)
    course = balances.run(time, u[:, None], np.array([True]), values)
    expected = course.shown[:, balances.outputs.index("shown:lower.y")]
    rules = rules_of(new)
    file = read_file(write_inputs(folder / "in.csv", time, u), rules, [])
    # Beyond its range a sensor shows the end of it.
    shown = predict(rules, [file]).values["lower.y"]
    np.testing.assert_allclose(shown, np.clip(expected, 0.0, 10.0), rtol=0, atol=1e-9)
    return expected


def adopted_tanks(folder: Path, *names: str) -> tuple[Path, dict[str, Any], ModelBuilder]:
    builder = opened(TANKS)
    found: Found = [(name, unknowns_of(builder, name)) for name in names]
    data, builder = mismatch(TANKS, found)
    return adopted(folder, data), data, builder


def test_overflow_of_one_tank(tmp_path: Path) -> None:
    """That tank gets a type of its own; what it loses and what is caught stand in its laws."""
    new, data, builder = adopted_tanks(tmp_path, CAUGHT)
    upper, lower = type_of(new, "upper"), type_of(new, "lower")
    assert ("open-tank-upper", 2) == (upper.name, upper.version)
    assert ("open-tank", 1) == (lower.name, lower.version)
    assert "(inflow_true - outflow)/A" == upper.states["h"].rate.text
    assert upper.definitions["inflow_true"].expression.text.startswith("inflow - ")
    assert upper.definitions["outflow"].expression.text.startswith("outflow_plain + f*")
    shown = assert_same_course(tmp_path, new, data, builder)
    plain = builder.balances(()).run(*plain_inputs(), values_of(data, builder)).shown
    assert np.abs(shown - plain[:, 0]).max() > 0.05
    assert 0 == main(["check", str(new)])


def plain_inputs() -> tuple[Array, Array, Array]:
    time, u = random_inputs(300)
    return time, u[:, None], np.array([True])


def values_of(data: Mapping[str, Any], builder: ModelBuilder) -> dict[str, float]:
    repair = data["repair"]
    moved = dict(zip(repair["parameters"], repair["values"], strict=True))
    return {**builder.parameters.constants, **moved}


def test_initial_states_are_taken_over(tmp_path: Path) -> None:
    """What was estimated of the beginning of a recording is where the new plant begins."""
    new, data, _ = adopted_tanks(tmp_path, CAUGHT)
    repair = data["repair"]
    dynamics = rules_of(new).dynamics
    assert dynamics is not None
    for name in ("upper.h0", "lower.h0"):
        fitted = repair["values"][repair["parameters"].index(name)]
        assert fitted == pytest.approx(dynamics.values[name], rel=1e-12)
        assert 0.08 != pytest.approx(fitted, rel=1e-3)


def test_values_alone(tmp_path: Path) -> None:
    """Nothing but other parameters: the types stay, states and readings as they were written."""
    data, builder = mismatch(TANKS, [])
    new = adopted(tmp_path, data)
    assert 1 == type_of(new, "upper").version
    assert_same_course(tmp_path, new, data, builder)


LAG = """\
effect: lag
title: Something that follows late
sort: physics
joins:
  - {gives: volume flow, law: z}
  - {flows: in, law: z}
  - {stores: level, law: z}
  - {shows: reading, law: z}
parameters:
  tau: {unit: s, null: 0, starts: [10, 60], range: [0, 1e5],
    usual: {median: 30, factor: 3, source: t},
    title: time constant}
states:
  z: {der: (law - z)/tau, start: law}
regime: after each change
text: "{module}: {place} follows with a lag of {tau}"
action: add what stores
source: "[assumed] for a test"
"""

STICK = """\
effect: stick
title: Something that turns back late
sort: physics
joins:
  - {shows: reading, law: z}
parameters:
  d: {unit: "1", null: 0, starts: [0.2], range: [0, 1e5],
    usual: {median: 0.1, factor: 3, source: t},
    title: half the width}
states:
  z: {der: 0, start: law, low: law - d, high: law + d}
regime: where the reading turns back
text: "{module}: {place} turns back after twice {d}"
action: free it
source: "[assumed] for a test"
"""


@pytest.fixture(scope="module")
def sticky(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The two tanks beside a knowledge base with effects that store."""
    folder = tmp_path_factory.mktemp("sticky")
    shutil.copytree(ROOT / "kb", folder / "kb")
    for name, text in (("lag", LAG), ("stick", STICK)):
        (folder / "kb" / "effects" / f"{name}.yaml").write_text(text, encoding="utf-8")
    return Path(shutil.copytree(TANKS, folder / "tanks"))


@pytest.mark.parametrize(
    "name",
    [
        "pump.lag@pump",
        "upper.lag@inflow",
        "upper.lag@outflow",
        "lower.lag@h",
        "lower.lag@y",
        "upper+lower.lag@outflow",
        "lower.stick@y",
    ],
)
def test_states_that_an_effect_brings_in(tmp_path: Path, sticky: Path, name: str) -> None:
    """Wherever it joins: written, read again, the same course."""
    builder = opened(sticky)
    data, builder = mismatch(sticky, [(name, unknowns_of(builder, name))])
    new = adopted(tmp_path, data)
    shown = assert_same_course(tmp_path, new, data, builder)
    plain = builder.balances(()).run(*plain_inputs(), values_of(data, builder))
    assert np.abs(shown - plain.shown[:, -1]).max() > 0.02
    assert 0 == main(["check", str(new)])


def test_a_pump_that_follows_late(tmp_path: Path, sticky: Path) -> None:
    """Its observer tells the settled flow; the tank gets the flow that follows late."""
    builder, name = opened(sticky), "pump.lag@pump"
    data, _ = mismatch(sticky, [(name, unknowns_of(builder, name))])
    kind = type_of(adopted(tmp_path, data), "pump")
    assert "pump_plain" == kind.observers["pump"].expression.text
    assert "z" == kind.definitions["outflow"].expression.text
    state = kind.states["z"]
    assert ("", "(pump_plain - z)/tau", "pump_plain") == (
        state.quantity,
        state.rate.text,
        state.start.text,
    )


UNWRITTEN = {
    "connecting-pipe": "lower.h is neither for upper",
    "drowned-outlet": "lower.h is neither for upper",
    "lift-level": "upper.h is neither for pump",
    "pump-back-pressure": "upper.h is neither for pump",
    "warm-up-flow": "a module type knows no time",
}
"""Effects that no module type may have today, and why: known gaps."""


def test_every_effect_of_the_catalogue(tmp_path: Path) -> None:
    """Physics at the first place where it joins the tanks: built in, written, read again."""
    builder, sources = opened(TANKS), read_plant(TANKS)
    known = {c.name: c for c in reversed(builder.candidates) if c.sort == "physics"}
    refused = {n: r for n, c in known.items() if (r := why_not(c, builder.network))}
    assert set(UNWRITTEN) == set(refused)
    assert all(UNWRITTEN[name] in reason for name, reason in refused.items())
    for effect in known.keys() - refused.keys():
        name = known[effect].id
        data, _ = mismatch(TANKS, [(name, unknowns_of(builder, name))])
        (tmp_path / "mismatch.json").write_text(json.dumps(data), encoding="utf-8")
        repair = repair_of(read_form(tmp_path / "mismatch.json"), tmp_path / "mismatch.json")
        adoption = adoption_of(builder, repair)
        assert [name] == [c.id for c in adoption.taken], adoption.left
        for path, text in plant_files(sources, adoption, repair):
            file = tmp_path / effect / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        assert_same_course(tmp_path, tmp_path / effect, data, builder)


def test_again(tmp_path: Path) -> None:
    """An adopted plant can be adopted into: what was written stays."""
    new, _, _ = adopted_tanks(tmp_path, CAUGHT)
    builder = opened(new)
    name = next(c.id for c in builder.candidates if c.id.startswith("lower.overflow-caught"))
    data, builder = mismatch(new, [(name, unknowns_of(builder, name))])
    (tmp_path / "second").mkdir()
    second = adopted(tmp_path / "second", data)
    assert "inflow_true" in type_of(second, "lower").definitions
    assert "inflow_true" in type_of(second, "upper").definitions
    assert_same_course(tmp_path, second, data, builder)
