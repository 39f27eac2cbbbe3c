"""Entries of the catalogue explain what the independent truth does: their laws, written twice."""

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.prove.truth.formulas import Names
from rulec.prove.truth.settled.effect import EFFECTS, Placed
from rulec.prove.truth.settled.effect_size import made_of
from rulec.prove.truth.settled.operated_plant import Scene, scene
from rulec.prove.truth.settled.rig import Rig
from rulec.prove.truth.settled.rigs import drawn_rig, write_plant
from rulec.prove.truth.streams import stream
from rulec.prove.truth.tanks.balance import integrate
from rulec.prove.truth.tanks.build import Setup, build
from rulec.prove.truth.tanks.plant import CASCADED, GRAVITY, Plant
from rulec.prove.truth.tanks.sensing import shown
from rulec.prove.truth.units import BAR, LITRE_PER_HOUR, RPM
from tests.conftest import ROOT
from tests.tank_row import SI, by_the_tool, parameters, without_errors

PIECES = 10

SAME_LEVEL = 1e-4
"""V by which a level is shown otherwise by two integrators."""

SAME = 0.05
"""Share of what an effect changes that two ways to smooth a root may differ by."""


TABLE = yaml.safe_load((ROOT / "tests" / "truth_entries.yaml").read_text(encoding="utf-8"))
Row = Mapping[str, Any]

NUMBERS: dict[str, Any] = {
    **{"BAR": BAR, "LITRE_PER_HOUR": LITRE_PER_HOUR, "RPM": RPM, "DAY": 86400.0},
    # Flow through 1 cm2 under 10 cm, m3/s.
    "ORIFICE": float(np.sqrt(2.0 * GRAVITY * 10.0)) * 1e-6,
}
"""Names in the formulas of the table."""


def numbers(formulas: Mapping[str, str | float], **given: Any) -> dict[str, Any]:
    names = Names(None, NUMBERS, **given)
    return {name: names.of(formula) for name, formula in formulas.items()}


@functools.cache
def tanks() -> tuple[Setup, Plant, ModelBuilder]:
    """Two tanks that are run in ramps, without errors of instruments."""
    setup = build(CASCADED, 5, 200, "ramps")
    _, builder = open_builder(ROOT / "plants" / CASCADED.name)
    return setup, without_errors(setup), builder


@functools.cache
def truth_of(name: str = "") -> np.ndarray:
    """True level of the lower tank, m."""
    setup, plant, _ = tanks()
    row = TABLE["tanks"].get(name, {})
    plant = plant.with_("upper", **numbers(row.get("tank", {})))
    plant = plant.with_("pump", **numbers(row.get("feed", {})))
    return 0.01 * integrate(plant, setup.time, setup.shown).levels[:, 1]


def model_of(row: Row, pieces: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Level and reading of the lower tank by the tool's model with the entry built in."""
    setup, _, builder = tanks()
    balances, base = builder.balances((row["entry"],)), builder.parameters
    values = {**dict(zip(base.ids, base.values.tolist(), strict=True)), **base.constants}
    values |= {name: v * SI[unit] for name, (v, unit) in parameters(setup).items()}
    factors = numbers(row.get("base", {}))
    values |= {name: values[name] * factor for name, factor in factors.items()}
    values |= {f"{row['entry']}.{n}": v for n, v in numbers(row["parameters"]).items()}
    course = by_the_tool(balances, values, setup, pieces)
    level, reading = balances.states.index("lower.h"), balances.outputs.index("shown:lower.y")
    return course.states[::pieces, level], course.shown[::pieces, reading]


@pytest.mark.parametrize("name", TABLE["tanks"])
def test_an_entry_of_tanks_does_what_the_truth_does(name: str) -> None:
    """With the same numbers; without the entry the levels are far off."""
    true, plain = truth_of(name), truth_of()
    off = np.sqrt(np.mean((model_of(TABLE["tanks"][name], PIECES)[0] - true) ** 2))
    change = np.sqrt(np.mean((plain - true) ** 2))
    assert change > 1e-3
    assert off < SAME * change


@pytest.mark.parametrize("name", TABLE["sensors"])
def test_an_entry_of_level_sensors_shows_what_the_truth_shows(name: str) -> None:
    """Of the same level, but for what two integrators differ by; without the entry far off."""
    setup, plant, _ = tanks()
    row = TABLE["sensors"][name]
    erring = plant.with_("lower.y", **numbers(row["sensor"]))
    course = integrate(plant, setup.time, setup.shown)
    true = shown(erring, course)["lower"]
    plain = shown(plant, course)["lower"]
    assert np.max(np.abs(plain - true)) > 0.1
    assert model_of(row)[1] == pytest.approx(true, abs=SAME_LEVEL)


ALONE = {"metered": "bench", "oil-warm": "warm", "valve": "valve"}
"""Kinds of pumps with plants of their own."""


@functools.cache
def settled(kind: str) -> Scene:
    """A pump of a kind, run in steps; dosing pumps feed a mixer together with another one."""
    if kind in ALONE:
        rig = drawn_rig(ALONE[kind], stream(1, "rig"), True)
    else:
        downstream = {"A": "M", "B": "M", "M": None}
        rig = Rig("two", {"A": kind, "B": "cavity"}, {"M": 1.0}, downstream)
    return scene(rig, 4, 120, "steps")


def flows_of_plan(name: str, folder: Path) -> Iterator[dict[str, np.ndarray]]:
    """Flow over the true one, by each observer of the tool: plain, and with its entry built in."""
    even = TABLE["settled"][name]
    module, drawn = even.get("module", "A"), settled(even["kind"])
    made = made_of(drawn, Placed(EFFECTS[name], module), even["size"], 7)
    truth = drawn.truly(made.changes)
    truth["M.Q"] = np.sum([v for n, v in truth.items() if n.endswith(".Q")], axis=0)
    entry = f"{module}.{even['entry']}"
    write_plant(drawn.rig, folder)
    _, builder = open_builder(folder)
    given = {**made.fixed, "size": made.size}
    for own in made.parameters.values():
        given |= own
    medians = own_of({**truth, **drawn.plain}).items()
    given |= {f"usual_{n}": float(np.median(v)) for n, v in medians}
    stated = numbers(even["parameters"], **given)
    shown = drawn.shown(truth, made.changes)
    values: dict[str, Any] = {**truth, **shown, **drawn.values, "time": drawn.time}
    values |= {f"{entry}.{n}": v for n, v in stated.items()}
    true, lead = truth[f"{module}.Q"], f"q:{module}."
    for joined in ((), (entry,)):
        plan = builder.plan(module, joined)
        flows = plan.run({n: values[n] for n in plan.inputs if n in values})
        yield {n.removeprefix(lead): np.asarray(v / true) for n, v in flows.items() if lead in n}


def own_of(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Readings of pump A by their own names."""
    return {n.removeprefix("A."): v for n, v in values.items() if n.startswith("A.")}


BACK_THROUGH_THE_IMPELLER = "power"
"""The observer that an entry of what flows back leaves wrong: in its catalogue the pump's power
belongs to the flow that leaves, in the truth to the flow through the impeller."""


@pytest.mark.parametrize(
    "name",
    [
        n if i % 3 == 0 else pytest.param(n, marks=pytest.mark.prove)
        for i, n in enumerate(TABLE["settled"])
    ],
)
def test_an_entry_of_settled_plants_does_what_the_truth_does(name: str, tmp_path: Path) -> None:
    """With the same numbers every observer tells the true flow; without the entry one does not."""
    plain, flows = flows_of_plan(name, tmp_path)
    own = TABLE["settled"][name]["observer"]
    assert np.max(np.abs(plain[own] - 1.0)) > 2e-3
    assert own in flows
    for observer, flow in flows.items():
        right = flow == pytest.approx(1.0, abs=1e-6)
        assert right or (name, observer) == ("worn-rings", BACK_THROUGH_THE_IMPELLER)


@pytest.mark.parametrize("formula", ["(lambda: 1)()", "[x for x in (1,)]", "size.__class__", "_x"])
def test_a_formula_is_an_expression_and_no_program(formula: str) -> None:
    with pytest.raises(ValueError, match="is no formula"):
        Names(None, {}, size=1.0).of(formula)
