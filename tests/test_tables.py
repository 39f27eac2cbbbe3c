"""Characteristics by points: what the plan, its derivatives and the simulation make of them."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from rulec.commands.check_files import collect
from rulec.effects.model_builder import open_builder
from rulec.effects.write_module import write_module
from rulec.knowledge.tables import equations
from rulec.language.expression import Expression, constant, parse
from rulec.passes.pipeline import compile_plant
from tests.written import write_plant

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
  Kv: {{over: x, in: "%", unit: m3/h/bar**0.5, points: {POINTS}, between: line, u: 0.05, accuracy: "10 %, IEC 60534-2-4", source: data sheet}}
observers:
  valve: {{component: valve, Q: Kv*sqrt(dp), source: IEC 60534-2-1}}
  flow:  {{component: line, Q: Q, source: flow meter}}
faults: [seat-deposit(Kv), slope(Q)]
"""  # noqa: E501


KINDS = ("line", "monotone-cubic")


@pytest.fixture(params=KINDS)
def between(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def plant(between: str, tmp_path: Path) -> Path:
    (tmp_path / "kb").mkdir()
    text = VALVE.replace("between: line", f"between: {between}")
    (tmp_path / "kb" / "own-valve.yaml").write_text(text, encoding="utf-8")
    return write_plant(tmp_path, {"A": "own-valve"})


def curve(points: list[list[float]], between: str, x: float | np.ndarray) -> np.ndarray:
    """By numpy's interpolation, or by scipy's; within the points."""
    at, value = np.array(points).T
    cubic = between == "monotone-cubic"
    return np.asarray(PchipInterpolator(at, value)(x) if cubic else np.interp(x, at, value))


def flow(x: np.ndarray, dp: float, between: str) -> np.ndarray:
    """m3/s; x in percent, dp in bar."""
    return np.asarray(curve(POINTS, between, x) * np.sqrt(dp) / 3600)


def written(name: str, over: str, between: str, points: list[list[float]]) -> dict[str, Expression]:
    table = {"over": over, "points": points, "between": between}
    return {part: parse(text) for part, text in equations(name, table).items()}


def value_at(definitions: dict[str, Expression], x: float) -> float:
    """What the last of some definitions gives, the others known."""
    given = {"x": x, "t_per": 1.0, "t_size": 1.0}
    for name, definition in definitions.items():
        found = constant(definition, given)
        assert found is not None
        given[name] = found
    return given["t"]


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.integers(-1000, 1000), min_size=2, max_size=12, unique=True),
    st.data(),
    st.sampled_from(KINDS),
)
def test_equation_runs_through_all_points(at: list[int], data: st.DataObject, between: str) -> None:
    """And between them as it should; it can be read whatever the numbers."""
    at.sort()
    values = [data.draw(st.floats(-1e3, 1e3, allow_subnormal=False)) for _ in at]
    points = [[float(a), v] for a, v in zip(at, values, strict=True)]
    definitions = written("t", "x", between, points)
    size = max(map(abs, values)) + 1.0
    for x in (*at, *(a + s * (b - a) for a, b in pairwise(at) for s in (0.3, 0.5))):
        expected = float(curve(points, between, x))
        assert value_at(definitions, float(x)) == pytest.approx(expected, abs=1e-4 * size)


def test_cubic_goes_on_straight() -> None:
    """Beyond its points, where scipy's polynomial would turn back; without a corner at its ends."""
    definitions = written("t", "x", "monotone-cubic", POINTS)
    for end, way in ((0.0, -1.0), (100.0, 1.0)):
        at, near, far = (value_at(definitions, end + way * s) for s in (0.0, 1e-3, 50.0))
        inside = value_at(definitions, end - way * 1e-3)
        assert far - at == pytest.approx(5e4 * (near - at), rel=1e-6)
        assert near - at == pytest.approx(at - inside, rel=1e-3)


def test_plan_gives_the_curve_its_slope_and_its_uncertainty(plant: Path, between: str) -> None:
    """At the points and between them; at a point of lines the mean of both slopes. Its size is off
    as a whole."""
    assert collect([plant]) == []
    ruleset = compile_plant(plant)
    x = np.array([10.0, 20.0, 35.0, 60.0, 80.0, 99.0])
    given = {"A.x": x / 100, "A.dp": np.full(6, 2e5), "A.Q": np.full(6, 1e-3)}
    # Errors of readings count as standard ones, where the plan takes their sizes: here 1.
    found = ruleset.plan.run({n: given.get(n, np.ones(6)) for n in ruleset.plan.inputs})
    np.testing.assert_allclose(found["q:A.valve"], flow(x, 2.0, between), rtol=1e-7)
    np.testing.assert_allclose(
        found["s:A.valve:A.Kv_size"], 0.05 * flow(x, 2.0, between), rtol=1e-7
    )
    slope = (flow(x + 1e-5, 2.0, between) - flow(x - 1e-5, 2.0, between)) / 2e-7
    ratio = found["s:A.valve:A.x"] / slope
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    (size,) = (p for p in ruleset.parameters if p.id == "A.Kv_size")
    assert (size.value, size.u, size.unit) == (1, 0.05, "m3/h/bar**0.5")
    assert "A.seat-deposit" in ruleset.fault_by_id


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
