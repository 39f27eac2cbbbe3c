"""Types of the library: laws against their sources, faults told apart."""

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
from tests.written import write_plant

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
        si = knowledge().units.parse(point["in"]).from_si(found[what])
        assert math.isclose(si, expected, rel_tol=share, abs_tol=NOTHING), (what, si, expected)


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
        published = point.pop(check["gives"])
        found = values_at(kind, {**given, **point})[check["gives"]]
        assert found == pytest.approx(published, rel=within), point


def stores(name: str) -> bool:
    return "states" in plain_yaml(ROOT / "kb" / "modules" / f"{name}.yaml")


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Ruleset:
    """All types that store nothing side by side as one plant: pumps and meters each with its
    neighbour, lines alone."""
    modules = {module_of(kind): kind for kind in LINES if not stores(kind)}
    connections = []
    for kind, entry in PUMPS.items():
        name, beside = module_of(kind), f"{module_of(kind)}_beside"
        modules[name] = f"{kind}, fluid: {entry.get('fluid', 'water')}"
        modules[beside] = f"{entry['beside']}, reference: {entry.get('reference', {'Q': 6})}"
        pair = (beside, name) if entry["beside"] == "metered-pump" else (name, beside)
        connections.append(" -> ".join(pair))
    folder = tmp_path_factory.mktemp("plant")
    return compile_plant(write_plant(folder, modules, ", ".join(connections), fluid="water"))


def module_of(kind: str) -> str:
    return kind.replace("-", "_")


@pytest.mark.parametrize("name", [*PUMPS, *(kind for kind in LINES if not stores(kind))])
def test_faults_are_told_apart_or_listed(plant: Ruleset, name: str) -> None:
    """Each fault shows in some residual; those that coincide are the ones of the table."""
    head = f"{module_of(name)}."
    faults = {f.id for f in plant.faults if f.id.startswith(head)}
    assert faults
    assert all(o.reference > 0 for o in plant.observers if o.id.startswith(head))
    listed = listed_of(name)
    assert faults - {cell.fault for cell in plant.cells} == set(plant.unobserved) & faults
    assert set(plant.unobserved) & faults == {head + fault for fault in listed.get("unseen", ())}
    groups = (group.faults for group in plant.ambiguous if group.kind == "coincide")
    own = (sorted(f.removeprefix(head) for f in group if f.startswith(head)) for group in groups)
    expected = sorted(sorted(group) for group in listed.get("together", ()))
    assert expected == sorted(group for group in own if len(group) > 1)


def listed_of(name: str) -> dict[str, Any]:
    """What a table says of the faults of a type: which act alike, and which nobody sees."""
    if name in PUMPS:
        return {"together": PUMPS[name].get("classes", ())}
    (listed,) = (part for part in LINES[name] if "together" in part)
    return listed


@pytest.mark.parametrize("name", [*filter(stores, LINES)])
def test_faults_of_stores_are_told_apart_or_listed(name: str, tmp_path: Path) -> None:
    """Of one that stores, between two pumps with meters."""
    modules = {"M": name, "A": "metered-pump", "B": "metered-pump"}
    ruleset = compile_plant(write_plant(tmp_path, modules, "A -> M, M -> B", fluid="water"))
    signature, listed = signature_of(ruleset), listed_of(name)
    assert signature is not None

    def full(fault: str) -> str:
        return fault if fault[:2] in ("A.", "B.") else f"M.{fault}"

    rows = zip(signature.faults, signature.signs, strict=True)
    assert {f for f, row in rows if not any(row)} == {full(f) for f in listed.get("unseen", ())}
    expected = {frozenset(map(full, group)) for group in listed["together"]}
    assert {frozenset(group) for group in signature.alike} == expected


@pytest.mark.parametrize("name", [n for n, entry in PUMPS.items() if "signs" in entry])
def test_a_fault_goes_the_way_it_is_told(plant: Ruleset, name: str) -> None:
    """The sign that a growing fault gives a residual, first estimate minus second."""
    module = module_of(name)
    slopes = {(cell.fault, cell.residual): cell.sensitivity for cell in plant.cells}
    for fault, (place, sign) in PUMPS[name]["signs"].items():
        beside, residual = place.startswith("beside."), place.removeprefix("beside.")
        slope = slopes[f"{module}.{fault}", f"{module}{'_beside' * beside}.{residual}"]
        assert slope * sign > 0.0, (fault, slope)
