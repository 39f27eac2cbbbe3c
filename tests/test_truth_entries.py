"""Entries of the catalogue explain what the independent truth does: their laws, written twice."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.prove.truth.settled.effect import EFFECTS, Placed
from rulec.prove.truth.settled.folder import write_plant
from rulec.prove.truth.settled.plan import FAMILIES
from rulec.prove.truth.settled.rig import Rig
from rulec.prove.truth.settled.scene import Scene, scene
from rulec.prove.truth.settled.sized import made_of
from rulec.prove.truth.streams import stream
from rulec.prove.truth.tanks import CASCADED, build
from rulec.prove.truth.tanks.balance import integrate
from rulec.prove.truth.tanks.build import Setup, parameters
from rulec.prove.truth.tanks.feed import Curve, Feed, Kink, Warming
from rulec.prove.truth.tanks.laws import GRAVITY
from rulec.prove.truth.tanks.plant import LevelSensor, Opening, Plant, Tank
from rulec.prove.truth.tanks.sensing import shown
from rulec.prove.truth.units import BAR, LITRE_PER_HOUR, RPM
from tests.conftest import ROOT

SI = {"cm": 1e-2, "cm2": 1e-4, "cm3/s/V": 1e-6, "V/cm": 100.0}
DAY, MINUTE = 86400.0, 60.0
PIECES = 10

SAME_LEVEL = 1e-4
"""V by which a level is shown otherwise by two integrators."""

SAME = 0.05
"""Share of what an effect changes that two ways to smooth a root may differ by."""


@dataclass(frozen=True)
class Twin:
    """An effect of a tank or feed of the truth, and its entry with the same numbers, SI.

    `parameters` belong to the entry; `base` replaces base parameters where the entry counts
    from a usual reading that the truth does not know.
    """

    entry: str
    tank: Callable[[Tank], Tank] | None = None
    feed: Callable[[Feed], Feed] | None = None
    parameters: Mapping[str, float] | None = None
    base: Mapping[str, float] | None = None


ORIFICE = float(np.sqrt(2.0 * GRAVITY * 10.0)) * 1e-6
"""Flow through 1 cm2 under 10 cm, m3/s."""

TWINS = {
    "drowned": Twin(
        "upper.drowned-outlet@outflow",
        tank=lambda t: replace(t, drowned=4.0),
        parameters={"s": 1.0, "z": 0.04},
    ),
    "link": Twin(
        "upper.connecting-pipe@outflow",
        tank=lambda t: replace(t, link=0.02),
        parameters={"x": 0.02, "q0": ORIFICE, "l0": 0.1},
    ),
    "drain": Twin(
        "upper.open-drain@inflow",
        tank=lambda t: replace(t, drain=0.02),
        parameters={"x": 0.02, "q0": ORIFICE, "l0": 0.1},
    ),
    "side": Twin(
        "upper.side-outlet@inflow",
        tank=lambda t: replace(t, side=Opening(0.05, 5.0)),
        parameters={"x": 0.05, "q0": ORIFICE, "l0": 0.1, "z": 0.05},
    ),
    "cone": Twin(
        "upper.conical-tank@h",
        tank=lambda t: replace(t, cone=0.05),
        parameters={"s": 1.0 / 3.0, "l0": 0.1},
        base={"upper.A": 1.5**2},
    ),
    "lying": Twin(
        "upper.lying-tank@h",
        tank=lambda t: replace(t, lying=20.0),
        parameters={"s": 1.0, "r": 2.0, "l0": 0.1},
        base={"upper.A": 1.0},
    ),
    "closing": Twin(
        "upper.outlet-fouling@outflow",
        tank=lambda t: replace(t, closing=1e-3),
        parameters={"w": 1e-3},
    ),
    "held": Twin(
        "pump.pump-back-pressure@pump",
        feed=lambda f: replace(f, held=0.02),
        parameters={"b": 0.25, "l0": 0.1},
        base={"pump.k": 0.8},
    ),
    "lift": Twin(
        "pump.pump-lift@pump",
        feed=lambda f: replace(f, lift=4.0),
        parameters={"s": 0.25, "u0": 4.0},
    ),
    "lift-level": Twin(
        "pump.lift-level@pump",
        feed=lambda f: replace(f, lift_level=0.2),
        parameters={"s": 0.125, "u0": 4.0, "l0": 0.1},
    ),
    "roll-off": Twin(
        "pump.pump-roll-off@pump",
        feed=lambda f: replace(f, roll=0.1),
        parameters={"k": 0.4, "u0": 4.0},
    ),
    "upturn": Twin(
        "pump.pump-upturn@pump",
        feed=lambda f: replace(f, kink=Kink(3.0, 0.4)),
        parameters={"b": 0.4, "u_c": 3.0, "u0": 4.0},
    ),
    "exponent": Twin(
        "pump.pump-exponent@pump",
        feed=lambda f: replace(f, curve=Curve(0.3, 4.0)),
        parameters={"m": 0.3, "u0": 4.0},
    ),
    "decline": Twin(
        "pump.pump-decline@pump",
        feed=lambda f: replace(f, decline=1e-4),
        parameters={"w": 1e-4},
    ),
    "play": Twin(
        "pump.backlash@u",
        feed=lambda f: replace(f, play=0.6),
        parameters={"d": 0.3},
    ),
    "rate": Twin(
        "pump.travel-rate@u",
        feed=lambda f: replace(f, rate=0.01),
        parameters={"tau": 400.0, "u0": 4.0},
    ),
    "pocket": Twin(
        "upper.air-pocket@inflow",
        feed=lambda f: replace(f, pocket=3.0),
        parameters={"tau": 60.0, "q0": 10e-6},
    ),
    "warm-up": Twin(
        "pump.warm-up-flow@pump",
        feed=lambda f: replace(f, warming=Warming(-0.3, 300.0)),
        parameters={"a": -0.3, "tau": 300.0},
    ),
}
"""By the truth's name of the effect. A base parameter counts as multiple of the true one."""


@functools.cache
def tanks() -> tuple[Setup, Plant, ModelBuilder]:
    """Two tanks that are run in ramps, without errors of instruments."""
    setup = build(CASCADED, 5, 200, "ramps")
    feed = replace(setup.plant.feed, zero=0.0)
    sensors = tuple(replace(s, zero=0.0) for s in setup.plant.sensors)
    _, builder = open_builder(ROOT / "plants" / CASCADED.name)
    return setup, replace(setup.plant, feed=feed, sensors=sensors), builder


def truth_of(twin: Twin | None) -> np.ndarray:
    """True level of the lower tank, m."""
    setup, plant, _ = tanks()
    if twin and twin.tank:
        plant = plant.with_tank(twin.tank(plant.tank("upper")))
    if twin and twin.feed:
        plant = replace(plant, feed=twin.feed(plant.feed))
    return 0.01 * integrate(plant, setup.time, setup.shown).levels[:, 1]


def model_of(twin: Twin) -> np.ndarray:
    """The same by the tool's model with the entry built in."""
    setup, _, builder = tanks()
    balances = builder.balances((twin.entry,))
    base = builder.parameters
    values = {**dict(zip(base.ids, base.values.tolist(), strict=True)), **base.constants}
    values |= {name: v * SI[unit] for name, (v, unit) in parameters(setup).items()}
    values |= {name: values[name] * factor for name, factor in (twin.base or {}).items()}
    values |= {f"{twin.entry}.{n}": v for n, v in (twin.parameters or {}).items()}
    count = (setup.time.size - 1) * PIECES + 1
    time = setup.layout.interval / PIECES * np.arange(float(count))
    fine = np.append(np.repeat(setup.shown[:-1], PIECES), setup.shown[-1])
    inputs = np.stack([time if n == "time" else fine for n in balances.inputs], 1)
    held = np.array([n != "time" for n in balances.inputs])
    course = balances.run(time, inputs, held, values)
    return np.asarray(course.states[::PIECES, balances.states.index("lower.h")])


@pytest.mark.parametrize("name", TWINS)
def test_an_entry_of_tanks_does_what_the_truth_does(name: str) -> None:
    """With the same numbers; without the entry the levels are far off."""
    true, plain = truth_of(TWINS[name]), truth_of(None)
    off = np.sqrt(np.mean((model_of(TWINS[name]) - true) ** 2))
    change = np.sqrt(np.mean((plain - true) ** 2))
    assert change > 1e-3
    assert off < SAME * change


SENSORS: dict[str, tuple[str, Callable[[LevelSensor], LevelSensor], dict[str, float]]] = {
    "two-slope": (
        "lower.two-slope-reading@y",
        lambda s: replace(s, kink=(3.0, 0.3)),
        {"b": 0.3, "r_c": 3.0},
    ),
    "live-zero": (
        "lower.sensor-live-zero@y",
        lambda s: replace(s, floor=3.0),
        {"c": 1.0, "bottom": 3.0},
    ),
    "overload": (
        "lower.sensor-overload@y",
        lambda s: replace(s, overload=(3.0, 0.2)),
        {"h": 0.2, "p_c": 3.0},
    ),
}
"""By the truth's name of an error of a level sensor: its entry, the sensor, the numbers, V."""


@pytest.mark.parametrize("name", SENSORS)
def test_an_entry_of_level_sensors_shows_what_the_truth_shows(name: str) -> None:
    """Of the same level, but for what two integrators differ by; without the entry far off."""
    setup, plant, builder = tanks()
    entry, erring, stated = SENSORS[name]
    course = integrate(plant, setup.time, setup.shown)
    true = shown(plant.with_sensor(erring(plant.sensor("lower"))), course)["lower"]
    plain = shown(plant, course)["lower"]
    balances = builder.balances((entry,))
    base = builder.parameters
    values = {**dict(zip(base.ids, base.values.tolist(), strict=True)), **base.constants}
    values |= {n: v * SI[unit] for n, (v, unit) in parameters(setup).items()}
    values |= {f"{entry}.{n}": v for n, v in stated.items()}
    found = balances.run(setup.time, setup.shown[:, None], np.array([True]), values)
    told = found.shown[:, balances.outputs.index("shown:lower.y")]
    assert np.max(np.abs(plain - true)) > 0.1
    assert told == pytest.approx(true, abs=SAME_LEVEL)


@dataclass(frozen=True)
class Even:
    """An effect of a settled plant, its entry at a place, and an observer that it puts right.

    `kind` is that of the pump that has it; `parameters` makes those of the entry, SI, of medians
    by signal and of the numbers of the effect.
    """

    kind: str
    size: float
    entry: str
    observer: str
    parameters: Callable[[Mapping[str, float], Mapping[str, float]], Mapping[str, float]]
    module: str = "A"


EVEN = {
    "slip-power": Even(
        "cavity", 0.5, "slip-exponent@Q_geo", "pump", lambda u, p: {"m": p["m"], "dp0": u["dp"]}
    ),
    "dp-misadjusted": Even(
        "cavity",
        0.2,
        "meter-misadjusted@dp",
        "pump",
        lambda u, p: {"z": p["zero"] + p["x"] * u["dp"], "x": p["x"], "r0": u["dp"]},
    ),
    "dp-two-slope": Even(
        "cavity",
        0.3,
        "two-slope-reading@dp",
        "pump",
        lambda u, p: {"b": p["b"], "r_c": p["r_c"] * BAR},
    ),
    "dp-bent": Even(
        "cavity",
        0.1,
        "bent-reading@dp",
        "pump",
        lambda u, p: {"b": p["size"], "r0": p["middle"], "w0": p["reach"]},
    ),
    "power-zero-creep": Even(
        "metered", 20.0, "zero-drift-time@P_el", "power", lambda u, p: {"z": p["z"] / DAY}
    ),
    "slip-dragged": Even(
        "membrane", 0.5, "slip-speed@Q_geo", "pump", lambda u, p: {"a": p["a"], "n0": u["n"]}
    ),
    "induction": Even(
        "cavity",
        0.03,
        "motor-slip@n",
        "pump",
        lambda u, p: {"s": p["size"], "n0": u["n"], "dp0": u["dp"]},
    ),
    "weakened": Even(
        "cavity",
        0.05,
        "field-weakening@n",
        "pump",
        lambda u, p: {"s": p["size"], "n_c": p["n_c"] * RPM, "dp0": u["dp"]},
    ),
    "folded-back": Even(
        "cavity", 0.3, "power-limit@n", "pump", lambda u, p: {"s": p["s"], "P_c": p["P_c"]}
    ),
    "stribeck": Even(
        "cavity",
        0.5,
        "stribeck-friction@P_law",
        "power",
        lambda u, p: {"k": 0.5, "e": p["reach"] / u["n"], "P0": u["P_el"], "n0": u["n"]},
    ),
    "heated": Even(
        "oil-warm",
        10.0,
        "self-heating@T",
        "pump",
        lambda u, p: {"r": p["r"], "P0": u["P_el"]},
    ),
    "mixer-transition": Even(
        "cavity",
        1.0,
        "line-transition@loss",
        "resis",
        lambda u, p: {"s": 1.0, "p_t": p["p_t"] * BAR},
        module="M",
    ),
    "worn": Even("cavity", 0.2, "line-erosion@plant", "plant", lambda u, p: {"w": p["w"] / DAY}),
    "hose": Even("cavity", 0.05, "hose-widening@plant", "plant", lambda u, p: {"c": p["c"] / BAR}),
    "power-speed": Even(
        "metered", 0.3, "power-speed@P_law", "power", lambda u, p: {"a": p["a"], "n0": u["n"]}
    ),
    "cavitation": Even(
        "metered",
        0.5,
        "suction-cavitation@dp_law",
        "head",
        lambda u, p: {"k": p["k"] / BAR, "p_c": p["p_c"] * BAR},
    ),
    "npsh": Even(
        "metered",
        0.5,
        "suction-npsh@dp_law",
        "head",
        lambda u, p: {
            "k": p["k"] / BAR,
            "p_c": p["p_c"] * BAR,
            "p_r": p["p_r"] * BAR,
            "n0": u["n"],
        },
    ),
    "part-load-head": Even(
        "metered",
        0.2,
        "part-load-head@dp_law",
        "head",
        lambda u, p: {"k": p["k"], "Q_c": p["Q_c"] * LITRE_PER_HOUR},
    ),
    "part-load-power": Even(
        "metered",
        0.3,
        "part-load-power@P_law",
        "power",
        lambda u, p: {"k": p["k"], "Q_c": p["Q_c"] * LITRE_PER_HOUR},
    ),
    "worn-rings": Even(
        "metered",
        100.0,
        "ring-wear@dp_law",
        "head",
        lambda u, p: {"w": p["w"] * LITRE_PER_HOUR / DAY, "dp0": u["dp"]},
    ),
    "narrowed": Even(
        "metered", 0.2, "impeller-fouling@dp_law", "head", lambda u, p: {"w": p["w"] / DAY}
    ),
    "percentage": Even(
        "valve", 1.0, "equal-percentage@x", "valve", lambda u, p: {"s": 1.0, "R": p["R"]}
    ),
    "quick": Even("valve", 0.4, "quick-opening@x", "valve", lambda u, p: {"m": p["m"]}),
    "open-seat": Even("valve", 0.05, "valve-seat-flow@x", "valve", lambda u, p: {"r": p["r"]}),
    "late": Even("valve", 0.05, "dead-band@x", "valve", lambda u, p: {"d": p["d"]}),
    "stopped": Even(
        "valve", 0.3, "pump-saturation@x", "valve", lambda u, p: {"s": p["s"], "c": 1.0}
    ),
    "heavy": Even(
        "valve", 1.0, "line-density@Q_law", "valve", lambda u, p: {"s": p["s"], "rho0": u["rho"]}
    ),
    "choked": Even(
        "valve",
        0.5,
        "choked-flow@Q_law",
        "valve",
        lambda u, p: {"s": 1.0, "F": p["F"], "p_v": p["p_v"] * BAR},
    ),
    "in-row": Even(
        "valve",
        0.2,
        "valve-reducers@Q_law",
        "valve",
        lambda u, p: {"k": p["size"], "Q0": u["Q"], "dp0": u["dp"]},
    ),
}


ALONE = {"metered": "bench", "oil-warm": "warm", "valve": "valve"}
"""Kinds of pumps with plants of their own."""


@functools.cache
def settled(kind: str) -> Scene:
    """A pump of a kind, run in steps; dosing pumps feed a mixer together with another one."""
    if kind in ALONE:
        rig = FAMILIES[ALONE[kind]](stream(1, "rig"), True)
    else:
        downstream = {"A": "M", "B": "M", "M": None}
        rig = Rig("two", {"A": kind, "B": "cavity"}, {"M": 1.0}, downstream)
    return scene(rig, 4, 120, "steps")


def flows_told(name: str, folder: Path, joined: bool) -> dict[str, np.ndarray]:
    """Flow over the true one, by each observer of the tool with its entry built in."""
    even, drawn = EVEN[name], settled(EVEN[name].kind)
    made = made_of(drawn, Placed(EFFECTS[name], even.module), even.size, 7)
    truth = drawn.truly(made.changes)
    truth["M.Q"] = np.sum([v for n, v in truth.items() if n.endswith(".Q")], axis=0)
    entry = f"{even.module}.{even.entry}"
    write_plant(drawn.rig, folder)
    _, builder = open_builder(folder)
    plan = builder.plan(even.module, (entry,) if joined else ())
    usual = {n: float(np.median(v)) for n, v in own_of({**truth, **drawn.plain}).items()}
    numbers = {**made.fixed, "size": made.size}
    for own in made.parameters.values():
        numbers |= own
    stated = even.parameters(usual, numbers)
    shown = drawn.shown(truth, made.changes)
    values: dict[str, Any] = {**truth, **shown, **drawn.values, "time": drawn.time}
    values |= {f"{entry}.{n}": v for n, v in stated.items()}
    told = plan.run({n: values[n] for n in plan.inputs if n in values})
    true, lead = truth[f"{even.module}.Q"], f"q:{even.module}."
    return {n.removeprefix(lead): np.asarray(v / true) for n, v in told.items() if lead in n}


def own_of(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Readings of pump A by their own names."""
    return {n.removeprefix("A."): v for n, v in values.items() if n.startswith("A.")}


BACK_THROUGH_THE_IMPELLER = "power"
"""The observer that an entry of what flows back leaves wrong: in its catalogue the pump's power
belongs to the flow that leaves, in the truth to the flow through the impeller."""


@pytest.mark.parametrize("name", EVEN)
def test_an_entry_of_settled_plants_does_what_the_truth_does(name: str, tmp_path: Path) -> None:
    """With the same numbers every observer tells the true flow; without the entry one does not."""
    plain = flows_told(name, tmp_path / "plain", False)[EVEN[name].observer]
    assert np.max(np.abs(plain - 1.0)) > 2e-3
    told = flows_told(name, tmp_path / "joined", True)
    assert EVEN[name].observer in told
    for observer, flow in told.items():
        right = flow == pytest.approx(1.0, abs=1e-6)
        assert right or (name, observer) == ("worn-rings", BACK_THROUGH_THE_IMPELLER)
