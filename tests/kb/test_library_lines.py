"""Valves, lines, vessels, exchangers, cylinder: laws against their sources, faults told apart."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.module_type import ModuleType
from rulec.knowledge.read import read_files
from rulec.knowledge.values_at import values_at
from rulec.language.units import Unit, unit_table
from rulec.limits import ASSUMED_ACCURACY
from rulec.passes.pipeline import compile_plant
from rulec.simulation.signature import signature_of
from tests.conftest import ROOT, plain_yaml

TYPES: dict[str, list[dict[str, Any]]] = plain_yaml(ROOT / "tests/kb/library-lines.yaml")
POINTS = [
    pytest.param(name, part, id=f"{name}-{i}")
    for name, parts in TYPES.items()
    for i, part in enumerate(parts)
    if "gives" in part
]
NOTHING = 1e-12
"""What counts as none where a source says 0, in the unit of the point."""


@functools.cache
def knowledge() -> Knowledge:
    (sources,), _, found = read_files([ROOT / "kb"])
    assert found == []
    return check_knowledge(sources)


@functools.cache
def unit(text: str) -> Unit:
    return unit_table(plain_yaml(ROOT / "kb/units.yaml")).parse(text)


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
    kind = knowledge().modules[name]
    found = values_at(kind, in_si(kind, point["given"]))
    for what, expected in point["gives"].items():
        share = point.get("within") or stated(kind, what)
        told = unit(point["in"]).from_si(found[what])
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


@pytest.mark.parametrize("name", TYPES)
def test_faults_are_told_apart_or_listed(name: str, tmp_path: Path) -> None:
    """In a small plant every fault is seen; what acts alike is known."""
    kind = knowledge().modules[name]
    ruleset = small_plant(kind, tmp_path)
    (listed,) = (part for part in TYPES[name] if "together" in part)
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


def test_every_point_has_a_source() -> None:
    assert all(part["source"] for parts in TYPES.values() for part in parts if "gives" in part)
