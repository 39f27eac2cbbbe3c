"""Types of the library: laws against their sources, faults told apart."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.knowledge.module_type import ModuleType
from rulec.knowledge.values_at import values_at
from rulec.limits import ASSUMED_ACCURACY
from rulec.passes.pipeline import compile_plant
from rulec.simulation.signature import signature_of
from tests.conftest import ROOT, plain_yaml
from tests.kb.test_effects import knowledge

LINES: dict[str, list[dict[str, Any]]] = plain_yaml(ROOT / "tests/kb/library-lines.yaml")
POINTS = [
    pytest.param(name, part, id=f"{name}-{i}")
    for name, parts in LINES.items()
    for i, part in enumerate(parts)
    if "gives" in part
]
NOTHING = 1e-12
"""What counts as none where a source says 0, in the unit of the point."""


def in_si(kind: ModuleType, given: Mapping[str, float]) -> dict[str, float]:
    """Parameters, and what is given in units of the type; what no unit is known of is SI."""
    units = {n: p.unit for n, p in kind.parameters.items()}
    units |= {n: s.unit for n, s in (*kind.signals.items(), *kind.states.items())}
    known = {n: p.value for n, p in kind.parameters.items()}
    return known | {n: units[n].to_si(v) if n in units else v for n, v in given.items()}


def stated(kind: ModuleType, name: str) -> float:
    """The share within which a law keeps, by its own file."""
    observer = kind.observers.get(name)
    of = [observer.accuracy] if observer else [kind.definitions[name].accuracy]
    if observer:
        used = kind.names_through(observer.expression) & kind.definitions.keys()
        of += [kind.definitions[n].accuracy for n in used]
    return max((a.share for a in of if a), default=ASSUMED_ACCURACY)


@pytest.mark.parametrize(("name", "point"), POINTS)
def test_laws_give_what_their_sources_say(name: str, point: dict[str, Any]) -> None:
    assert point["source"]
    kind = knowledge().modules[name]
    found = values_at(kind, in_si(kind, point["given"]))
    for what, expected in point["gives"].items():
        share = point.get("within") or stated(kind, what)
        told = knowledge().units.parse(point["in"]).from_si(found[what])
        assert math.isclose(told, expected, rel_tol=share, abs_tol=NOTHING), (what, told, expected)


def small_plant(kind: ModuleType, folder: Path) -> Ruleset:
    """The module alone; one that stores between two pumps with meters."""
    lines = ["plant: small", "title: small", "fluid: water", f"kb: {ROOT / 'kb'}", "modules:"]
    lines += [f"  M: {{type: {kind.name}}}"]
    if kind.states:
        lines += ["  A: {type: metered-pump}", "  B: {type: metered-pump}"]
        lines += ["connections: [A -> M, M -> B]"]
    file = folder / "plant.yaml"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return compile_plant(file)


@pytest.mark.parametrize("name", LINES)
def test_faults_are_told_apart_or_listed(name: str, tmp_path: Path) -> None:
    """In a small plant every fault is seen; what acts alike is known."""
    kind = knowledge().modules[name]
    ruleset = small_plant(kind, tmp_path)
    (listed,) = (part for part in LINES[name] if "together" in part)
    if kind.states:
        signature = signature_of(ruleset)
        assert signature is not None
        unseen = {
            f for f, row in zip(signature.faults, signature.signs, strict=True) if not any(row)
        }
        groups = signature.alike
    else:
        unseen = {fault.id for fault in ruleset.faults} & set(ruleset.unobserved)
        groups = tuple(g.faults for g in ruleset.ambiguous if g.kind == "coincide")
        assert all(observer.reference > 0 for observer in ruleset.observers)

    def full(fault: str) -> str:
        return fault if fault[:2] in ("A.", "B.") else f"M.{fault}"

    assert unseen == {full(f) for f in listed.get("unseen", ())}
    expected = {frozenset(map(full, group)) for group in listed["together"]}
    assert {frozenset(group) for group in groups} == expected


PUMPS = plain_yaml(ROOT / "tests/kb/library_pumps.yaml")
PUBLISHED = [
    pytest.param(kind, check, id=f"{kind}: {check['gives']}, {check['source'][:40]}")
    for kind, entry in PUMPS.items()
    for check in entry.get("checks", ())
]


def si(text: str) -> float:
    """A value with its unit, such as ``40 mPas``."""
    number, _, unit = text.partition(" ")
    return knowledge().units.parse(unit).to_si(float(number))


def rows(check: Mapping[str, Any]) -> Iterator[dict[str, float]]:
    """Published points, SI; where the table leaves some open they are calculated by `fluids`."""
    for row in check["rows"]:
        point = {
            name: knowledge().units.parse(unit).to_si(value)
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


@pytest.mark.parametrize(("name", "check"), PUBLISHED)
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


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Ruleset:
    """All types of the table side by side as one plant, each with its neighbour."""
    lines = ["plant: library", "title: library", "fluid: water", f"kb: {ROOT / 'kb'}", "modules:"]
    connections = ["connections:"]
    for kind, entry in PUMPS.items():
        name, fluid = kind.replace("-", "_"), entry.get("fluid", "water")
        lines += [f"  {name}: {{type: {kind}, fluid: {fluid}}}"]
        reference = entry.get("reference", {"Q": 6})
        lines += [f"  {name}_beside: {{type: {entry['beside']}, reference: {reference}}}"]
        pump = entry["beside"] != "metered-pump"
        pair = (name, f"{name}_beside") if pump else (f"{name}_beside", name)
        connections.append(f"  - {' -> '.join(pair)}")
    file: Path = tmp_path_factory.mktemp("plant") / "plant.yaml"
    file.write_text("\n".join([*lines, *connections]) + "\n", encoding="utf-8")
    return compile_plant(file)


def coinciding(ruleset: Ruleset, kind: str) -> list[list[str]]:
    """Own faults of a type that no residual of this plant tells apart, by group."""
    head = f"{kind.replace('-', '_')}."
    groups = (group.faults for group in ruleset.ambiguous if group.kind == "coincide")
    own = (sorted(f.removeprefix(head) for f in group if f.startswith(head)) for group in groups)
    return sorted(group for group in own if len(group) > 1)


@pytest.mark.parametrize("name", PUMPS)
def test_faults_of_pumps_are_told_apart_or_listed(plant: Ruleset, name: str) -> None:
    """Each fault shows in some residual; those that coincide are the ones of the table."""
    head = f"{name.replace('-', '_')}."
    faults = {f.id for f in plant.faults if f.id.startswith(head)}
    assert faults
    assert faults <= {cell.fault for cell in plant.cells}
    expected = sorted(sorted(group) for group in PUMPS[name].get("classes", ()))
    assert expected == coinciding(plant, name)


@pytest.mark.parametrize("name", [n for n, entry in PUMPS.items() if "signs" in entry])
def test_a_fault_goes_the_way_it_is_told(plant: Ruleset, name: str) -> None:
    """The sign that a growing fault gives a residual, first estimate minus second."""
    module = name.replace("-", "_")
    slopes = {(cell.fault, cell.residual): cell.sensitivity for cell in plant.cells}
    for fault, (place, sign) in PUMPS[name]["signs"].items():
        beside, residual = place.startswith("beside."), place.removeprefix("beside.")
        told = slopes[f"{module}.{fault}", f"{module}{'_beside' * beside}.{residual}"]
        assert told * sign > 0.0, (fault, told)
