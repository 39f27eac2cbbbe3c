"""Splits, parallel mixers, recirculation, modules without observer; residual identities and rank of
trees (method.md, claims 1 and 2).

The solver here is independent of the compiler. Unknown are the flow of every branch, the pressure
rise of every pump, and the pressure of every node; the equations are the laws of the branches and
continuity at the nodes. `OUTSIDE` is at zero pressure. Values are in bar, l/h, rpm and W.
Source: own derivation; laws and values from method.md, section 5.
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from scipy.optimize import root

from rulec.commands.matrix import json_form
from rulec.passes.pipeline import compile_plant
from tests.method.readings import (
    PLANTS,
    evaluate,
    noise_free,
    points,
    row_of,
    ruleset,
    signs,
    to_si,
)

OUTSIDE = "outside"
TOLERANCE, ACCEPTED = 1e-14, 1e-10
UNIT = 500.0
"""l/h; flows are solved in this unit and pressures in bar, so that all are of order one."""


@dataclass(frozen=True)
class Resistance:
    """A branch that loses `quadratic` Q |Q|; bar/(l/h)2. `shown`: a sensor measures its loss."""

    tail: str
    head: str
    quadratic: float = 0.0
    shown: bool = True


@dataclass(frozen=True)
class DosingBranch:
    """A progressive cavity pump at a speed (rpm), with its line.

    Flow of the pump: 0.6 n - 6 - 0.010 n - 2 dp |dp| with V = 10 ml/rev; its line loses
    0.05 bar + 5.2e-6 Q |Q|; power: 25 + 0.095 n + 0.6 n dp / 36 / 0.70.
    """

    tail: str
    head: str
    speed: float = 900.0


Branch = Resistance | DosingBranch


def readings(branches: Mapping[str, Branch], degrees: Mapping[str, float]) -> dict[str, float]:
    """Columns such as ``A.dp [bar]``, with faults such as ``M.clogging`` of some degrees."""
    flow, rise = solve(branches, degrees)
    shown: dict[str, float] = {}
    for name, branch in branches.items():
        if isinstance(branch, DosingBranch):
            n, dp = branch.speed, rise[name]
            shown[f"{name}.n [rpm]"] = n
            shown[f"{name}.dp [bar]"] = dp * _change(degrees, f"{name}.dp")
            power = 25.0 + 0.095 * n + 0.6 * n * dp / 36.0 / 0.70
            shown[f"{name}.P_el [W]"] = power * _change(degrees, f"{name}.P_el")
        elif branch.shown:
            loss = _quadratic(branch, name, degrees) * flow[name] * abs(flow[name])
            shown[f"{name}.dp [bar]"] = loss * _change(degrees, f"{name}.dp")
    return shown


def solve(
    branches: Mapping[str, Branch], degrees: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    """The flow of every branch (l/h) and the pressure rise of every pump (bar)."""
    pumps = [name for name, branch in branches.items() if isinstance(branch, DosingBranch)]
    ends = dict.fromkeys(n for b in branches.values() for n in (b.tail, b.head))
    nodes = [n for n in ends if n != OUTSIDE]
    cuts = np.cumsum([len(branches), len(pumps)])

    def named(x: Array) -> list[dict[str, float]]:
        """Flows in UNIT, rises of pumps and pressures of nodes, bar."""
        parts = zip((branches, pumps, nodes), np.split(x, cuts), strict=True)
        return [dict(zip(names, v.tolist(), strict=True)) for names, v in parts]

    def errors(x: Array) -> list[float]:
        flow, rise, pressure = named(x)
        pressure[OUTSIDE] = 0.0
        found = []
        for name, branch in branches.items():
            static, quadratic, added = 0.0, 0.0, 0.0
            if isinstance(branch, DosingBranch):
                added = rise[name]
                share = (1.0 - degrees.get(f"{name}.leakage", 0.0)) / UNIT
                slip = 2.0 * added * abs(added)
                found.append(flow[name] - share * (0.59 * branch.speed - 6.0 - slip))
                static, quadratic = 0.05, 5.2e-6 * _friction(degrees, name)
            else:
                quadratic = _quadratic(branch, name, degrees)
            loss = static + quadratic * UNIT**2 * flow[name] * abs(flow[name])
            found.append(pressure[branch.head] - pressure[branch.tail] + loss - added)
        for node in nodes:
            into = sum(flow[n] for n, b in branches.items() if b.head == node)
            found.append(into - sum(flow[n] for n, b in branches.items() if b.tail == node))
        return found

    solved = root(errors, np.ones(cuts[-1] + len(nodes)), method="lm", tol=TOLERANCE)
    assert np.max(np.abs(solved.fun)) < ACCEPTED, "no operating point"
    flow, rise, _ = named(solved.x)
    return {name: UNIT * q for name, q in flow.items()}, rise


def _change(degrees: Mapping[str, float], sensor: str) -> float:
    return (1.0 + degrees.get(f"{sensor}.high", 0.0)) * (1.0 - degrees.get(f"{sensor}.low", 0.0))


def _friction(degrees: Mapping[str, float], name: str) -> float:
    clogged, widened = (degrees.get(f"{name}.{kind}", 0.0) for kind in ("clogging", "widening"))
    return (1.0 + clogged) * (1.0 - widened)


def _quadratic(branch: Resistance, name: str, degrees: Mapping[str, float]) -> float:
    return branch.quadratic * _friction(degrees, name)


NARROW, DN15, HEADER = 9.0e-7, 3.5e-7, 2.0e-7
FEEDS: dict[str, Branch] = {
    "A": DosingBranch(OUTSIDE, "in"),
    "B": DosingBranch(OUTSIDE, "in", 800.0),
}
BRANCHES: dict[str, dict[str, Branch]] = {
    "parallel": {
        **FEEDS,
        "M1": Resistance("in", "out", DN15),
        "M2": Resistance("in", "out", NARROW),
        "C": Resistance("out", OUTSIDE, DN15),
    },
    "recirculation": {
        "A": DosingBranch(OUTSIDE, "in"),
        "R": DosingBranch("out", "in", 500.0),
        "M": Resistance("in", "out", DN15),
        "E": Resistance("out", OUTSIDE, DN15),
    },
    "pipe": {
        **FEEDS,
        "P": Resistance("in", "out", shown=False),
        "C": Resistance("out", OUTSIDE, DN15),
    },
    "header": {
        **FEEDS,
        "H": Resistance("in", "split", HEADER),
        "K1": Resistance("split", "vessel", DN15),
        "K2": Resistance("split", "vessel", NARROW),
        "T": Resistance("vessel", OUTSIDE, shown=False),
    },
}
BRANCHES["half-header"] = {
    **BRANCHES["header"],
    "K2": Resistance("split", "vessel", NARROW, shown=False),
}
UNOBSERVED = {
    "parallel": set(),
    "recirculation": set(),
    "pipe": {"P"},
    "header": {"T"},
    "half-header": {"K2", "T", "K1.clogging", "K1.widening"},
}


def values(plant: str, fault: str = "", degree: float = 0.0) -> dict[str, Array]:
    """Noise-free readings of the independent solver, SI."""
    found = readings(BRANCHES[plant], {fault: degree} if fault else {})
    return to_si(ruleset(plant), {name: np.array([value]) for name, value in found.items()})


@pytest.mark.parametrize("plant", BRANCHES)
def test_loops_and_splits(plant: str) -> None:
    """On a healthy plant all residuals vanish to 1e-6 of the flow, named or not. A fault of 20 %
    moves exactly the residuals that the matrix says, the way it says; what leaves no trace is told.
    """
    rules, healthy = ruleset(plant), values(plant)
    found, flow = evaluate(rules, healthy), rules.observer_by_id["A.pump"].reference
    basis = residual_basis(rules, np.ones(len(rules.observers), dtype=bool))
    flows = np.array([found[f"q:{o.id}"][0] for o in rules.observers])
    named = [found[f"R:{r.id}"][0] for r in rules.residuals]
    assert 0.0 == pytest.approx(np.abs([*named, *(basis @ flows)]).max(), abs=1e-6 * flow)
    assert [False] == isolate(rules, observe(rules, points(rules, healthy))).deviating.tolist()
    form, residuals = json_form(rules), [r.id for r in rules.residuals]
    for fault in (f.id for f in rules.faults):
        shown = evaluate(rules, values(plant, fault, 0.2))
        assert row_of(form, fault) == signs(shown, residuals, flow), fault
    assert UNOBSERVED[plant] == set(rules.unobserved)


def test_as_adjacency_matrix(tmp_path: Path) -> None:
    """The same graph as a matrix gives the same residuals and signs."""
    data: dict[str, Any] = yaml.safe_load((PLANTS / "half-header" / "plant.yaml").read_text())
    names = list(data["modules"])
    edges = {tuple(c.split(" -> ")) for c in data.pop("connections")}
    with (tmp_path / "a.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["", *names])
        writer.writerows([a, *(int((a, b) in edges) for b in names)] for a in names)
    (tmp_path / "plant.yaml").write_text(yaml.dump({**data, "adjacency": "a.csv"}, sort_keys=False))
    assert json_form(ruleset("half-header")) == json_form(compile_plant(tmp_path))


TREES = {"abc": (2, 1), "three": (3, 1), "series": (3, 2), "mixing-rig": (5, 2)}
"""Dosing modules and mixers."""


def scattered(plant: str) -> dict[str, Array]:
    """Readings far from any operating point; all square roots exist."""
    random = np.random.default_rng(1)
    ranges = {"n": (1.0, 1.2), "dp": (0.9, 1.0), "P_el": (0.2, 2.0), "mixer": (0.3, 0.8)}
    result = {}
    for name, healthy in noise_free(plant).items():
        module, signal = name.split(".")
        is_mixer = f"{module}.resis" in ruleset(plant).observer_by_id
        low, high = ranges.get("mixer" if is_mixer else signal, (1.0, 1.0))
        result[name] = healthy[0] * random.uniform(low, high, 200)
    return result


@pytest.mark.parametrize("plant", TREES)
def test_residual_identities(plant: str) -> None:
    """Three identities tie the residuals together for any readings, to 1e-9 of the flow: of 9
    residuals 5 are independent, of 21 residuals 12, two per dosing module and one per mixer. Seven
    faults per dosing module and four per mixer."""
    rules, found = ruleset(plant), evaluate(ruleset(plant), scattered(plant))
    R = {r.id: found[f"R:{r.id}"] for r in rules.residuals}
    flow = 1e-9 * rules.observer_by_id["A.pump"].reference
    dosing = [m for m in rules.modules if f"{m}.power-pump" in R]
    mixers = [m for m in rules.modules if m not in dosing]
    assert all(np.isfinite(r).all() for r in R.values())
    for m in dosing:
        expected = R[f"{m}.power-plant"] - R[f"{m}.pump-plant"]
        assert expected == pytest.approx(R[f"{m}.power-pump"], abs=flow)
    for m in mixers:
        (spec,) = (r for r in rules.residuals if r.id == f"{m}.pump-resis")
        upstream = [t.observer.split(".")[0] for t in spec.terms if t.sign > 0]
        for kind in ("pump", "power"):
            expected = sum(R[f"{n}.{kind}-plant"] for n in upstream) + R[f"{m}.plant-resis"]
            assert expected == pytest.approx(R[f"{m}.{kind}-resis"], abs=flow)
    assert TREES[plant] == (len(dosing), len(mixers))
    basis = residual_basis(rules, np.ones(len(rules.observers), dtype=bool))
    assert 2 * len(dosing) + len(mixers) == len(basis)
    assert 3 * (len(dosing) + len(mixers)) == len(R)
    assert 7 * len(dosing) + 4 * len(mixers) == len(rules.faults)
