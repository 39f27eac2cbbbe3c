"""Characteristics by points: what the plan, its derivatives and the simulation make of them."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.effects.model_builder import open_builder
from rulec.effects.write_module import write_module
from rulec.knowledge.tables import equation
from rulec.language.expression import constant, parse
from rulec.language.functions import Signum
from rulec.language.symbolic import to_sympy
from rulec.passes.pipeline import compile_plant

POINTS = [[0, 0.1], [20, 0.5], [50, 1.5], [80, 3.4], [100, 4.0]]
VALVE = f"""\
module: own-valve
version: 1
title: Valve whose flow coefficient is given by points
signals:
  x:  {{quantity: valve travel, unit: "%", sensor: positioner, range: [0, 100], input: true, reference: 60}}
  dp: {{quantity: pressure difference, unit: bar, sensor: piezoresistive, range: [0, 10], input: true, reference: 2}}
  Q:  {{quantity: volume flow, unit: m3/h, sensor: magnetic-inductive, range: [0, 20], reference: 3}}
tables:
  Kv: {{over: x, in: "%", unit: m3/h/bar**0.5, points: {POINTS}, u: 0.05, source: data sheet}}
observers:
  valve: {{component: valve, Q: Kv*sqrt(dp), source: IEC 60534-2-1}}
  flow:  {{component: line, Q: Q, source: flow meter}}
faults: [blockage(Kv), slope(Q)]
"""  # noqa: E501


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    (tmp_path / "kb").mkdir()
    (tmp_path / "kb" / "own-valve.yaml").write_text(VALVE, encoding="utf-8")
    text = "plant: p\ntitle: t\nmodules: {A: {type: own-valve}}\n"
    (tmp_path / "plant.yaml").write_text(text, encoding="utf-8")
    return tmp_path


def flow(x: np.ndarray, dp: float) -> np.ndarray:
    """m3/s, by numpy's own interpolation; x in percent, dp in bar."""
    at, value = np.array(POINTS).T
    return np.interp(x, at, value) * np.sqrt(dp) / 3600


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.integers(-1000, 1000), min_size=2, max_size=12, unique=True),
    st.data(),
)
def test_equation_runs_through_all_points(at: list[int], data: st.DataObject) -> None:
    """And straight between them; it can be read whatever the numbers."""
    at.sort()
    values = [data.draw(st.floats(-1e3, 1e3, allow_subnormal=False)) for _ in at]
    table = {"over": "x", "points": [[float(a), v] for a, v in zip(at, values, strict=True)]}
    curve = parse(equation("t", table))
    size = max(map(abs, values)) + 1.0
    for x in (*at, *(0.5 * (a + b) for a, b in pairwise(at))):
        found = constant(curve, {"x": float(x), "t_per": 1.0, "t_size": 1.0})
        assert found == pytest.approx(np.interp(x, at, values), abs=1e-4 * size)


def test_plan_gives_the_curve_its_slope_and_its_uncertainty(plant: Path) -> None:
    """Between the points and beyond the last; its size is off as a whole."""
    assert collect([plant]) == []
    ruleset = compile_plant(plant)
    x = np.array([10.0, 35.0, 60.0, 99.0])
    given = {"A.x": x / 100, "A.dp": np.full(4, 2e5), "A.Q": np.full(4, 1e-3)}
    # Errors of readings count as standard ones, where the plan takes their sizes: here 1.
    found = ruleset.plan.run({n: given.get(n, np.ones(4)) for n in ruleset.plan.inputs})
    np.testing.assert_allclose(found["q:A.valve"], flow(x, 2.0), rtol=1e-7)
    np.testing.assert_allclose(found["s:A.valve:A.Kv_size"], 0.05 * flow(x, 2.0), rtol=1e-7)
    slope = (flow(x + 0.1, 2.0) - flow(x - 0.1, 2.0)) / 0.002
    ratio = found["s:A.valve:A.x"] / slope
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    (size,) = (p for p in ruleset.parameters if p.id == "A.Kv_size")
    assert (size.value, size.u, size.unit) == (1, 0.05, "m3/h/bar**0.5")
    assert "A.blockage" in ruleset.fault_by_id


def test_simulation_follows_the_curve(plant: Path) -> None:
    rows = [f"{t},{x},2,0" for t, x in enumerate((5, 20, 42, 77, 100))]
    (plant / "in.csv").write_text("\n".join(["time [s],A.x [%],A.dp [bar],A.Q [m3/h]", *rows]))
    assert main(["simulate", str(plant), str(plant / "in.csv"), "-o", str(plant / "out.csv")]) == 0
    table = np.genfromtxt(plant / "out.csv", delimiter=",", names=True, deletechars="")
    expected = 3600 * flow(np.array([5.0, 20.0, 42.0, 77.0, 100.0]), 2.0)
    np.testing.assert_allclose(table["A.Q_[m3/h]"], expected, rtol=1e-5)


def test_slope_is_that_of_the_lines(plant: Path) -> None:
    """As symbols, of which the compiler makes its gradients; at a point the mean of both sides."""
    t = sympy.Symbol("x", real=True)
    table = {"over": "x", "points": POINTS}
    symbols = {"x": t, "Kv_per": sympy.Integer(1), "Kv_size": sympy.Integer(1)}
    slope = to_sympy(parse(equation("Kv", table)), symbols).diff(t)
    values = [float(slope.subs(t, at).replace(Signum, sympy.sign)) for at in (10, 20, 30, 99)]
    assert values == pytest.approx([0.02, (0.02 + 1 / 30) / 2, 1 / 30, 0.03])


def test_amended_type_holds_the_curve_as_an_equation(plant: Path, tmp_path: Path) -> None:
    """As `rulec adopt` writes it: the same flows, from plain definitions and parameters."""
    _, builder = open_builder(plant)
    assert builder.sources is not None
    (document,) = builder.sources.by_kind["module"]
    before = compile_plant(plant)
    text = write_module(document, builder.network.plant.modules["A"].type, {}, [])
    assert "tables" not in text
    (plant / "kb" / "own-valve.yaml").write_text(text, encoding="utf-8")
    assert collect([plant]) == []
    assert compile_plant(plant).plan == before.plan
