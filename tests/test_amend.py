"""Laws built into module types: what stands where afterwards, and what its plan gives."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
import yaml
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.effects.model_builder import ModelBuilder, open_builder, reference_readings
from rulec.effects.places import parameter_values
from rulec.passes.lower import Lowering, lower_module
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from tests.conftest import ROOT
from tests.effects import ALL, LAMINAR, OFFSET, SPEED, WARM, with_effects

PLANTS = (
    "abc",
    "mixing-rig",
    "hsy-pumping",
    "zema-hydraulic",
    "zema-hydraulic/without-temperature.yaml",
)


def opened(plant: str) -> tuple[Compilation, Ruleset, ModelBuilder]:
    """A shipped plant with the effects of the tests."""
    plain = run_passes(Compilation(path=ROOT / "plants" / Path(plant)))
    ruleset = plain.ruleset
    models = with_effects(plain, *ALL)
    return models, ruleset, ModelBuilder(models, reference_readings(models, ruleset))


@pytest.fixture(scope="module")
def rig() -> tuple[Compilation, Ruleset, ModelBuilder]:
    return opened("mixing-rig")


@pytest.fixture(scope="module")
def pump_set() -> tuple[Compilation, Ruleset, ModelBuilder]:
    return opened("zema-hydraulic/without-temperature.yaml")


def around(models: Compilation, ruleset: Ruleset, seed: int = 1) -> dict[str, Array | float]:
    """Readings at random points around the reference, with the values of all parameters."""
    random = np.random.default_rng(seed)
    plant = models.network.plant
    values: dict[str, Array | float] = {**parameter_values(plant)}
    for name, reading in reference_readings(models, ruleset).items():
        values[name] = reading * (1.0 + 0.05 * random.standard_normal(40))
    return values


def flows(outputs: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    return ((name, value) for name, value in outputs.items() if name.startswith("q:"))


@pytest.mark.parametrize("plant", PLANTS)
def test_lowered_equations_are_those_of_the_ruleset(plant: str) -> None:
    """Straight from the tree or by way of sympy: observers and guards agree to 1e-12."""
    models, ruleset, _ = opened(plant)
    values = around(models, ruleset)
    known = dict.fromkeys(ruleset.plan.inputs, 1.0)
    expected = ruleset.plan.run({**known, **values})
    compared = 0
    for module in models.network.plant.modules:
        plan = lower_module(Lowering(models.network, {}), module)
        for name, value in plan.run(values).items():
            np.testing.assert_allclose(value, expected[name], rtol=1e-12)
            compared += 1
    assert compared == sum(1 + len(o.guards) for o in ruleset.observers)


@pytest.mark.parametrize("plant", PLANTS)
def test_at_the_null_the_plain_relation_comes_back(plant: str) -> None:
    """Every candidate at every place it fits, whatever its other parameters are."""
    models, ruleset, builder = opened(plant)
    values = around(models, ruleset) | {"time": 100.0}
    for candidate in builder.candidates:
        own = {
            u.id: u.null if u.null is not None else _first(values, u.driver)
            for u in candidate.unknowns
        }
        for module in {o.split(".")[0] for o in candidate.observers}:
            plain = builder.plan(module, ()).run(values)
            joined = builder.plan(module, (candidate.id,)).run({**values, **own})
            for name, value in flows(plain):
                np.testing.assert_allclose(joined[name], value, rtol=1e-12, err_msg=candidate.id)


def _first(values: Mapping[str, Array | float], driver: str | None) -> float:
    return 1.0 if driver is None else float(np.ravel(values[driver])[0])


def test_slip_that_grows_with_temperature(
    pump_set: tuple[Compilation, Ruleset, ModelBuilder],
) -> None:
    """The plan of an amended module, against the formula written out by hand."""
    models, ruleset, builder = pump_set
    values = around(models, ruleset)
    name = "main.warm-slip@Q_law"
    out = builder.plan("main", (name,)).run({**values, f"{name}.b": 0.03, f"{name}.T0": 310.0})
    q0, c1 = values["main.Q0"], values["main.C1"]
    slip = c1 * values["main.dp"] * np.exp(0.03 * (values["main.T"] - 310.0))
    np.testing.assert_allclose(out["q:main.pump"], q0 - slip, rtol=1e-13)
    law = values["main.P0"] + values["main.P1"] * values["main.dp"]
    np.testing.assert_allclose(
        out["q:main.power"], (q0 - slip) * values["main.P_el"] / law, rtol=1e-13
    )


def test_equations_are_told_over_what_an_author_wrote(
    rig: tuple[Compilation, Ruleset, ModelBuilder],
) -> None:
    """Definitions that were brought in are written out; a driver replaced goes all the way in."""
    told = {c.id: c.equation for c in rig[2].candidates}
    assert (
        "Q_geo = n*(1 - s*dp)*V - (C0 + C1*(n*(1 - s*dp)) + C2*dp**2)"
        == (told["A.speed-loss@Q_geo"])
    )
    assert "plant = sqrt(sqrt(loss/k2)**2 + a**2/4) - a/2" == told["A.laminar-part@plant"]
    assert "dp_mod = dp - downstream(dp_mix) - p" == told["A.cracking@dp_mod"]
    assert "true dp = dp - a" == told["A.offset@dp"]
    assert "Q_geo = n*V - Q_slip - c*time" == told["A.wear@Q_geo"]


def test_joined_one_after_the_other_at_one_place(
    rig: tuple[Compilation, Ruleset, ModelBuilder],
) -> None:
    """The second law stands on the first; their parameters have names of their own."""
    models, ruleset, builder = rig
    values = around(models, ruleset)
    warm, slow = f"A.{WARM.name}@Q_geo", f"A.{SPEED.name}@Q_geo"
    own = {f"{warm}.b": 0.02, f"{warm}.T0": 290.0, f"{slow}.s": 1e-7}
    out = builder.plan("A", (slow, warm)).run({**values, **own})
    v = {name: values[f"A.{name}"] for name in ("n", "dp", "T", "V", "C0", "C1", "C2")}
    speed = v["n"] * (1.0 - 1e-7 * v["dp"])
    without = v["n"] * v["V"] - v["C0"] - v["C1"] * v["n"]
    plain = speed * v["V"] - v["C0"] - v["C1"] * speed - v["C2"] * v["dp"] ** 2
    expected = without - (without - plain) * np.exp(0.02 * (v["T"] - 290.0))
    np.testing.assert_allclose(out["q:A.pump"], expected, rtol=1e-12)
    assert "law" not in builder.equation("A", (slow, warm), "Q_geo")


def test_laws_of_a_line_stand_beside_each_other_in_any_order() -> None:
    """What one builds in may have no value at the flow of 0 at which another asks for the law.

    Friction over a flow divides by it: there the law beneath counts.
    """
    _, builder = open_builder(ROOT / "plants" / "hsy-pumping")
    own = [c for c in builder.candidates if c.module == "P11" and not c.members]
    names = [c.id for c in own if c.place == "head" and c.sort != "fault"]
    assert len(names) > 2
    told = [builder.equation("P11", joined, "head") for joined in itertools.permutations(names, 3)]
    assert all("law" not in text and "/0" not in text for text in told)


def test_a_corrected_reading_drives_what_is_joined_before_and_after(
    rig: tuple[Compilation, Ruleset, ModelBuilder],
) -> None:
    """The order of acceptance does not matter, and the reading counts everywhere as corrected."""
    models, ruleset, builder = rig
    values = around(models, ruleset)
    slow, offset = f"A.{SPEED.name}@Q_geo", f"A.{OFFSET.name}@dp"
    own = {f"{slow}.s": 1e-7, f"{offset}.a": 2e4}
    one = builder.plan("A", (slow, offset)).run({**values, **own})
    other = builder.plan("A", (offset, slow)).run({**values, **own})
    true = {**values, "A.dp": values["A.dp"] - 2e4}
    expected = builder.plan("A", (slow,)).run({**true, **own})
    for name, value in flows(expected):
        np.testing.assert_allclose(one[name], value, rtol=1e-13)
        np.testing.assert_allclose(other[name], value, rtol=1e-13)


def test_a_sensor_error_reaches_the_modules_that_read_it(
    rig: tuple[Compilation, Ruleset, ModelBuilder],
) -> None:
    """The offset of a mixer's transmitter shifts the back pressure of a dosing module."""
    models, ruleset, builder = rig
    values = around(models, ruleset)
    offset = f"M1.{OFFSET.name}@dp"
    out = builder.plan("A", (offset,)).run({**values, f"{offset}.a": 1e4})
    true = {**values, "M1.dp": values["M1.dp"] - 1e4}
    expected = builder.plan("A", ()).run(true)
    np.testing.assert_allclose(out["q:A.plant"], expected["q:A.plant"], rtol=1e-13)
    other = f"B.{LAMINAR.name}@plant"
    assert builder.plan("A", (offset,)) is builder.plan("A", (offset, other))


def test_a_spot_shifts_its_place(rig: tuple[Compilation, Ruleset, ModelBuilder]) -> None:
    """An error in a definition is added, an error in a reading is taken off."""
    models, ruleset, builder = rig
    values = around(models, ruleset)
    spots = {s.id: s for s in builder.spots}
    loss, reading = spots["definition:A.loss"], spots["signal:A.dp"]
    plain = builder.plan("A", ()).run(values)["q:A.plant"]
    added = builder.plan("A", (), (loss.id,)).run({**values, loss.unknown: 1e4})["q:A.plant"]
    np.testing.assert_allclose(added**2 - plain**2, 1e4 / values["A.k2"], rtol=1e-9)
    taken = builder.plan("A", (), (reading.id,)).run({**values, reading.unknown: 1e4})
    true = builder.plan("A", ()).run({**values, "A.dp": values["A.dp"] - 1e4})
    for name, value in flows(true):
        np.testing.assert_allclose(taken[name], value, rtol=1e-13)


def test_free_form_is_a_sum_of_products_of_readings(
    rig: tuple[Compilation, Ruleset, ModelBuilder],
) -> None:
    """Each reading less its median and over its spread; the same call, the same candidate."""
    models, ruleset, builder = rig
    values = around(models, ruleset)
    spot = next(s for s in builder.spots if s.id == "definition:A.Q_geo")
    free = builder.free_form(spot.id, ("A.T", "A.T*A.dp"))
    assert free is builder.free_form(spot.id, ("A.T", "A.T*A.dp"))
    assert ["c1", "c2", "x1_m", "x1_s", "x2_m", "x2_s"] == [u.name for u in free.unknowns]
    numbers = dict(zip((u.id for u in free.unknowns), (1e-6, 2e-6, 290, 5, 2e5, 1e4), strict=True))
    out = builder.plan("A", (free.id,)).run({**values, **numbers})["q:A.pump"]
    plain = builder.plan("A", ()).run(values)["q:A.pump"]
    warm, high = (values["A.T"] - 290) / 5, (values["A.dp"] - 2e5) / 1e4
    np.testing.assert_allclose(out - plain, 1e-6 * warm + 2e-6 * warm * high, rtol=1e-9)


def test_free_curve_goes_straight_from_quantile_to_quantile(
    rig: tuple[Compilation, Ruleset, ModelBuilder],
) -> None:
    """Bands left out are zero at their quantile; beyond the ends the curve stays."""
    models, ruleset, builder = rig
    values = around(models, ruleset)
    spot = next(s for s in builder.spots if s.id == "definition:A.Q_geo")
    free = builder.free_form(spot.id, tuple(f"A.T~{i}/4" for i in (0, 1, 3, 4)))
    own = {u.name: u for u in free.unknowns}
    knots = np.quantile(values["A.T"], [0.1, 0.3, 0.5, 0.8, 0.9])
    level = {"c1": 1e-6, "c2": 3e-6, "c3": -2e-6, "c4": 5e-6}
    assert {*level, "x_0", "x_1", "x_2", "x_3", "x_4"} == set(own)
    assert [(i / 4,) for i in range(5)] == [own[f"x_{i}"].quantiles for i in range(5)]
    numbers = level | {f"x_{i}": x for i, x in enumerate(knots.tolist())}
    given = {own[name].id: value for name, value in numbers.items()}
    out = builder.plan("A", (free.id,)).run({**values, **given})["q:A.pump"]
    plain = builder.plan("A", ()).run(values)["q:A.pump"]
    curve = np.interp(values["A.T"], knots, [1e-6, 3e-6, 0.0, -2e-6, 5e-6])
    np.testing.assert_allclose(out - plain, curve, rtol=1e-9, atol=1e-15)


def test_base_parameters_carry_their_covariance(
    rig: tuple[Compilation, Ruleset, ModelBuilder],
) -> None:
    """Uncertain ones may be moved, with the correlations of the calibration; others are given."""
    base = rig[2].parameters
    place = {name: i for i, name in enumerate(base.ids)}
    first, second = place["M1.k0"], place["M1.k2"]
    assert "A.V" in base.constants
    assert "A.V" not in place
    scale = base.factors[first] * base.factors[second]
    file = ROOT / "plants" / "mixing-rig" / "calibration.yaml"
    (block,) = yaml.safe_load(file.read_text(encoding="utf-8"))["modules"]["M1"]["covariance"]
    expected = block["matrix"][block["of"].index("k0")][block["of"].index("k2")]
    assert base.covariance[first, second] / scale == pytest.approx(expected, rel=1e-3)
    assert 0.0 == base.covariance[first, place["A.k2"]]
    # What the data sheet says stands beside what was calibrated with it.
    value, u = base.sheet["A.k2"]
    assert (5.2e-6, 2.0e-8) == pytest.approx([v / base.factors[place["A.k2"]] for v in (value, u)])
    assert u > np.sqrt(base.covariance[place["A.k2"], place["A.k2"]])
