"""Pumps, drives and meters of the library against their sources, table library_pumps.yaml."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.effects.model_builder import open_builder
from rulec.knowledge.values_at import values_at
from rulec.language.units import UnitTable
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, plain_yaml
from tests.kb.test_effects import knowledge

TABLE = plain_yaml(ROOT / "tests/kb/library_pumps.yaml")
CHECKS = [
    pytest.param(kind, check, id=f"{kind}: {check['gives']}, {check['source'][:40]}")
    for kind, entry in TABLE.items()
    for check in entry.get("checks", ())
]


def units() -> UnitTable:
    return knowledge().units


def si(text: str) -> float:
    """A value with its unit, such as ``40 mPas``."""
    number, _, unit = text.partition(" ")
    return units().parse(unit).to_si(float(number))


def rows(check: Mapping[str, Any]) -> Iterator[dict[str, float]]:
    """Published points, SI; where the table leaves some open they are calculated by `fluids`."""
    for row in check["rows"]:
        point = {
            name: units().parse(unit).to_si(value)
            for (name, unit), value in zip(check["columns"].items(), row, strict=True)
            if value is not None
        }
        if "fluids" in check:
            flow, loss = by_fluids(point["dp"], check)
            point |= {check["gives"]: flow} | ({"w": loss} if "w" in check["columns"] else {})
        yield point


def by_fluids(dp: float, check: Mapping[str, Any]) -> tuple[float, float]:
    """Volume flow and pressure loss of a meter by ISO 5167 at a pressure difference, SI."""
    from fluids.flow_meter import (
        differential_pressure_meter_C_epsilon,
        differential_pressure_meter_dP,
        differential_pressure_meter_solver,
    )

    of, liquid = check["fluids"], {k: si(v) for k, v in check["liquid"].items()}
    meter = {"D": si(of["D"]), "D2": si(of["d"]), "P1": 2e6, "P2": 2e6 - dp}
    kinds = {"meter_type": of["meter"], "taps": of.get("taps")}
    state = {"rho": liquid["density"], "mu": liquid["viscosity"], "k": 1.3}
    mass = differential_pressure_meter_solver(**meter, **state, **kinds, epsilon_specified=1.0)
    C, _ = differential_pressure_meter_C_epsilon(
        **meter, **state, **kinds, m=mass, epsilon_specified=1.0
    )
    loss = differential_pressure_meter_dP(**meter, C=C, meter_type=of["meter"])
    return mass / liquid["density"], loss


@pytest.mark.parametrize(("name", "check"), CHECKS)
def test_a_law_keeps_to_what_is_published(name: str, check: Mapping[str, Any]) -> None:
    """Within the sum of the accuracies that its laws state, and of no wider band."""
    kind = knowledge().modules[name]
    stated = {path[-1]: accuracy for path, accuracy in kind.laws().items()}
    stated |= {d.name: d.accuracy for d in kind.definitions.values() if d.accuracy}
    within = sum(accuracy.share for law in check["laws"] if (accuracy := stated[law]))
    assert within > 0.0
    stated_there = {**check.get("parameters", {}), **check.get("liquid", {})}
    given = {"T": 293.15} | {name: si(text) for name, text in stated_there.items()}
    for point in rows(check):
        told = point.pop(check["gives"])
        found = values_at(kind, {**given, **point})[check["gives"]]
        assert found == pytest.approx(told, rel=within), point


def write_plant(folder: Path, table: Mapping[str, Mapping[str, Any]]) -> None:
    """Types side by side, each with its neighbour, as one plant."""
    lines = ["plant: library", "title: library", "fluid: water", f"kb: {ROOT / 'kb'}", "modules:"]
    connections = ["connections:"]
    for kind, entry in table.items():
        name, fluid = kind.replace("-", "_"), entry.get("fluid", "water")
        lines += [f"  {name}: {{type: {kind}, fluid: {fluid}}}"]
        reference = entry.get("reference", {"Q": 6})
        lines += [f"  {name}_beside: {{type: {entry['beside']}, reference: {reference}}}"]
        pump = entry["beside"] != "metered-pump"
        pair = (name, f"{name}_beside") if pump else (f"{name}_beside", name)
        connections.append(f"  - {' -> '.join(pair)}")
    text = "\n".join([*lines, *connections]) + "\n"
    (folder / "plant.yaml").write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Ruleset:
    """All types of the table as one plant."""
    folder: Path = tmp_path_factory.mktemp("plant")
    write_plant(folder, TABLE)
    return compile_plant(folder)


def coinciding(ruleset: Ruleset, kind: str) -> list[list[str]]:
    """Own faults of a type that no residual of this plant tells apart, by group."""
    head = f"{kind.replace('-', '_')}."
    groups = (group.faults for group in ruleset.ambiguous if group.kind == "coincide")
    own = (sorted(f.removeprefix(head) for f in group if f.startswith(head)) for group in groups)
    return sorted(group for group in own if len(group) > 1)


@pytest.mark.parametrize("name", TABLE)
def test_faults_are_told_apart_or_listed(plant: Ruleset, name: str) -> None:
    """Each fault shows in some residual; those that coincide are the ones of the table."""
    head = f"{name.replace('-', '_')}."
    faults = {f.id for f in plant.faults if f.id.startswith(head)}
    assert faults
    assert faults <= {cell.fault for cell in plant.cells}
    expected = sorted(sorted(group) for group in TABLE[name].get("classes", ()))
    assert expected == coinciding(plant, name)


@pytest.mark.parametrize("name", [n for n, entry in TABLE.items() if "signs" in entry])
def test_a_fault_goes_the_way_it_is_told(plant: Ruleset, name: str) -> None:
    """The sign that a growing fault gives a residual, first estimate minus second."""
    module = name.replace("-", "_")
    slopes = {(cell.fault, cell.residual): cell.sensitivity for cell in plant.cells}
    for fault, (place, sign) in TABLE[name]["signs"].items():
        beside, residual = place.startswith("beside."), place.removeprefix("beside.")
        told = slopes[f"{module}.{fault}", f"{module}{'_beside' * beside}.{residual}"]
        assert told * sign > 0.0, (fault, told)


@pytest.mark.parametrize(
    ("effect", "places"),
    [
        ("hose-fatigue", {"peristaltic_pump.V_turn", "diaphragm_metering.V_stroke"}),
        ("rotor-friction", {"turbine_meter.f", "oval_gear_meter.f"}),
        ("tube-pressure", {"coriolis_meter.m", "coriolis_meter_loss.m"}),
    ],
)
def test_effects_of_the_new_types_join_them(tmp_path: Path, effect: str, places: set[str]) -> None:
    """And nothing else of the library."""
    kinds = {place.partition(".")[0].replace("_", "-") for place in places}
    write_plant(tmp_path, {kind: TABLE[kind] for kind in sorted(kinds | {"gear-pump"})})
    candidates = open_builder(tmp_path)[1].candidates
    assert places == {f"{c.module}.{c.place}" for c in candidates if c.name == effect}
