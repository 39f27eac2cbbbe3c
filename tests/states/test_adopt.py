"""Physics that a plant left out in what it stores, taken over: it predicts as the analysis did."""

import json
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
from rulec.knowledge.read import read_plant
from rulec.simulation.predict import predict
from tests.states.plants import TANKS, random_inputs, write_inputs
from tests.test_adopt import adopted, builder_of, mismatch, models_of, rules_of, values_of

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


def assert_same_course(
    folder: Path, new: Path, data: Mapping[str, Any], builder: ModelBuilder, at_least: float = 0.0
) -> None:
    """The new plant, read from its files, predicts what the analysis had: to 1e-9 V; and somewhere
    by at least so many volts another level than without what was joined."""
    values = values_of(data, builder)
    time, u = random_inputs(300)

    def course(joined: tuple[str, ...]) -> Array:
        balances = builder.balances(joined)
        shown = balances.run(time, u[:, None], np.array([True]), values).shown
        return np.asarray(shown[:, balances.outputs.index("shown:lower.y")])

    expected = course(tuple(entry["id"] for entry in data["repair"]["joined"]))
    rules = rules_of(new)
    file = read_file(write_inputs(folder / "in.csv", time, u), rules, [])
    # Beyond its range a sensor shows the end of it.
    shown = predict(rules, [file]).values["lower.y"]
    np.testing.assert_allclose(shown, np.clip(expected, 0.0, 10.0), rtol=0, atol=1e-9)
    assert np.abs(expected - course(())).max() >= at_least


def test_overflow_of_one_tank(tmp_path: Path) -> None:
    """That tank gets a type of its own; what it loses and what is caught stand in its laws."""
    data, builder = mismatch(TANKS, [(CAUGHT, unknowns_of(builder_of(TANKS), CAUGHT))])
    new = adopted(tmp_path, data)
    upper, lower = (models_of(new).plant.modules[name].type for name in ("upper", "lower"))
    assert ("open-tank-upper", 2) == (upper.name, upper.version)
    assert ("open-tank", 1) == (lower.name, lower.version)
    assert "(inflow_true - outflow*leaving)/A" == upper.states["h"].rate.text
    assert upper.definitions["inflow_true"].expression.text.startswith("inflow - ")
    assert upper.definitions["outflow"].expression.text.startswith("outflow_plain + f*")
    assert_same_course(tmp_path, new, data, builder, at_least=0.05)
    assert 0 == main(["check", str(new)])
    # What was estimated of the beginning of a recording is where the new plant begins.
    repair, dynamics = data["repair"], rules_of(new).dynamics
    assert dynamics is not None
    for name in ("upper.h0", "lower.h0"):
        fitted = repair["values"][repair["parameters"].index(name)]
        assert fitted == pytest.approx(dynamics.values[name], rel=1e-12)
        assert 0.08 != pytest.approx(fitted, rel=1e-3)


def test_states_that_an_effect_brings_in(tmp_path: Path) -> None:
    """Written, read again, the same course, which is another than without. The observer of a pump
    that follows late tells the settled flow; the tank gets the flow that follows."""
    name = "pump.lag-flow@pump"
    data, builder = mismatch(TANKS, [(name, unknowns_of(builder_of(TANKS), name))])
    new = adopted(tmp_path, data)
    assert_same_course(tmp_path, new, data, builder, at_least=0.02)
    assert 0 == main(["check", str(new)])
    kind = models_of(new).plant.modules["pump"].type
    assert "pump_plain" == kind.observers["pump"].expression.text
    assert "z" == kind.definitions["outflow"].expression.text
    assert "(pump_plain - z)/tau" == kind.states["z"].rate.text
    assert "pump_plain" == kind.states["z"].start.text


UNWRITTEN = {
    "connecting-pipe": "lower.h is neither for upper",
    "drowned-outlet": "lower.h is neither for upper",
    "lift-level": "upper.h is neither for pump",
    "pump-back-pressure": "upper.h is neither for pump",
    "warm-up-flow": "a module type knows no time",
}
"""Effects that no module type may have today, and why: known gaps."""


@pytest.mark.prove
def test_every_effect_of_the_catalogue(tmp_path: Path) -> None:
    """Physics at the first place where it joins the tanks: built in, written, read again."""
    builder, sources = builder_of(TANKS), read_plant(TANKS)
    candidates = {c.name: c for c in reversed(builder.candidates) if c.sort == "physics"}
    refused = {n: r for n, c in candidates.items() if (r := why_not(c, builder.network))}
    assert set(UNWRITTEN) == set(refused)
    assert all(UNWRITTEN[name] in reason for name, reason in refused.items())
    for effect in candidates.keys() - refused.keys():
        name = candidates[effect].id
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
