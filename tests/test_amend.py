"""Effects for tests, built into module types: what stands where afterwards, and what it gives."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.commands.check_files import collect
from rulec.effects.model_builder import ModelBuilder, open_builder, reference_readings
from rulec.effects.places import parameter_values
from rulec.effects.write_module import write_module
from rulec.knowledge.effect import Driver, Effect, EffectLaw, EffectParameter, Join
from rulec.language.expression import parse
from rulec.language.origin import Origin
from rulec.language.units import UNKNOWN, Unit
from rulec.passes.lower import Lowering, lower_module
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from tests.conftest import ROOT


def join(
    law: str,
    *,
    gives: str = "",
    reads: str = "",
    falls_with: str = "",
    rises_with: str = "",
    measured: bool = False,
    substitutes: Mapping[str, Mapping[str, str]] | None = None,
) -> Join:
    """A join; `substitutes` is ``{"law_1": {"dp": "0"}}`` for a law with ``law_1`` in it."""
    table = {
        key: {driver: parse(by) for driver, by in replaced.items()}
        for key, replaced in (substitutes or {}).items()
    }
    return Join(
        reads=reads,
        gives=gives,
        falls_with=falls_with,
        rises_with=rises_with,
        measured=measured,
        law=EffectLaw(law, parse(law), table),
    )


def driver(quantity: str, where: str = "own") -> Driver:
    return Driver("", quantity, where, quantity)


def parameter(
    null: float | None = 0.0,
    lowest: float = -1e9,
    highest: float = 1e9,
    starts: tuple[float, ...] = (),
    of: str | None = None,
    fixed: bool = False,
    unit: str = "1",
) -> EffectParameter:
    return EffectParameter(
        name="",
        title="",
        unit=Unit(unit, 1.0, UNKNOWN),
        null=null,
        lowest=lowest,
        highest=highest,
        starts=starts,
        driver=of,
        fixed=fixed,
    )


def effect(
    name: str,
    *joins: Join,
    sort: str = "physics",
    drivers: Mapping[str, Driver] | None = None,
    parameters: Mapping[str, EffectParameter] | None = None,
    text: str = "{module}: {place}",
) -> Effect:
    return Effect(
        name=name,
        title=name.replace("-", " "),
        sort=sort,
        joins=joins,
        drivers={n: replace(d, name=n) for n, d in (drivers or {}).items()},
        parameters={n: replace(p, name=n, title=n) for n, p in (parameters or {}).items()},
        text=text,
        action="",
        origin=Origin("tests/test_amend.py", 1, "own"),
    )


WARM = effect(
    "warm-slip",
    join(
        "law_1 - (law_1 - law)*exp(b*(T - T0))",
        gives="volume flow",
        falls_with="dp",
        substitutes={"law_1": {"dp": "0"}},
    ),
    drivers={"dp": driver("pressure difference"), "T": driver("temperature", "plant")},
    parameters={
        "b": parameter(0.0, -0.02, 0.2, (0.02,), unit="1/K"),
        "T0": parameter(None, of="T", fixed=True, unit="K"),
    },
    text="{module}: the slip grows by {b} with {T}",
)
OFFSET = effect(
    "offset",
    join("law - a", reads="any"),
    sort="sensor",
    parameters={"a": parameter()},
)
LAMINAR = effect(
    "laminar-part",
    join("sqrt(law**2 + a**2/4) - a/2", gives="volume flow", rises_with="dp"),
    drivers={"dp": driver("pressure difference")},
    parameters={"a": parameter(0.0, 0.0, 1.0, unit="m3/s")},
)
SPEED = effect(
    "speed-loss",
    join(
        "law_1",
        gives="volume flow",
        falls_with="dp",
        substitutes={"law_1": {"n": "n*(1 - s*dp)"}},
    ),
    drivers={"dp": driver("pressure difference"), "n": driver("rotational speed")},
    parameters={"s": parameter(0.0, 0.0, 1.0, unit="1/Pa")},
)
HEADER = effect(
    "shared-header",
    join("law + k*F**2", gives="level", rises_with="Q", measured=False),
    drivers={"Q": driver("volume flow"), "F": driver("volume flow", "downstream")},
    parameters={"k": parameter()},
)
ALL = (WARM, OFFSET, LAMINAR, SPEED, HEADER)


def with_effects(models: Compilation, *effects: Effect) -> Compilation:
    """Compilation whose knowledge has these effects and no others."""
    known = replace(models.plant.knowledge, effects={e.name: e for e in effects})
    plant = replace(models.plant, knowledge=known)
    return replace(models, plant=plant, network=replace(models.network, plant=plant))


PLANTS = ("mixing-rig", "hsy-pumping", "zema-hydraulic")
Opened = tuple[Compilation, Ruleset, ModelBuilder]


def opened(plant: str) -> Opened:
    """A shipped plant with the effects of the tests."""
    plain = run_passes(Compilation(path=ROOT / "plants" / Path(plant)))
    ruleset = plain.ruleset
    models = with_effects(plain, *ALL)
    return models, ruleset, ModelBuilder(models, reference_readings(models, ruleset))


@pytest.fixture(scope="module")
def rig() -> Opened:
    return opened("mixing-rig")


@pytest.fixture(scope="module")
def pump_set() -> Opened:
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
    pump_set: Opened,
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
    rig: Opened,
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


def test_base_parameters_carry_their_covariance(
    rig: Opened,
) -> None:
    """Uncertain ones may be moved, with the correlations of the calibration; others are given."""
    base = rig[2].parameters
    assert set(base.ids) == set(base.sheet)
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


def test_a_law_keeps_its_accuracy_where_its_error_looks_like_anothers() -> None:
    """An error of the head shifts the loss as far; as a place where something acts, one counts."""
    _, builder = open_builder(ROOT / "plants" / "rse-boiler")
    stated = {law.place: law.accuracy for law in builder.laws}
    assert {"head": 0.05, "opening": 0.1, "resistance": 0.08} == stated
    assert "head" not in {spot.place for spot in builder.spots}


@pytest.mark.parametrize(("share", "told"), [(0.5, []), (-0.5, ["KB125"])])
def test_an_amended_type_says_what_its_new_parts_may_be(
    share: float, told: list[str], tmp_path: Path
) -> None:
    """A share lies in its range; what a reading should be is no law that may be off by 5 %."""
    _, builder = open_builder(ROOT / "plants" / "rse-boiler")
    assert builder.sources is not None
    documents = builder.sources.by_kind["module"]
    (document,) = (d for d in documents if d.data["module"] == "pumped-valve-branch")
    (effect,) = (c for c in builder.candidates if c.name == "equal-percentage")
    kind = replace(builder.amended("boiler", (effect.id,)).type, name="own")
    values = {"s": share, "R": 30.0}
    brought = {n: replace(kind.parameters[n], value=v, u=0.1) for n, v in values.items()}
    text = write_module(document, kind, brought, [])
    (tmp_path / "kind.yaml").write_text(text, encoding="utf-8")
    assert told == [d.code for d in collect([tmp_path])]
    assert "range: [3, 300]" in text
    assert 'accuracy: "0 %, the class of the sensor says it"' in text
