"""What has no name is told with its shape, and with whether the way there matters.

Each time the catalogue has the right entry when the recording is made, and lacks it when it is
searched. What is made is no form that another entry has.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.effects.model_builder import open_builder
from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.pictures import pictures_of
from rulec.mismatch.answer.shapes import answer_of
from rulec.mismatch.result import Location, Mismatch, Shape
from rulec.mismatch.search.basis import Basis
from rulec.mismatch.search.branches import gap_between, ways_there
from rulec.mismatch.search.curve_found import Branches
from tests.conftest import ROOT
from tests.runtime.mismatch.made import alone, compared, recorded, tour

SAMPLES, RPM = 360, 1.0 / 60.0
PLANT = Path(__file__).parent / "plant.yaml"
EFFECT = """
effect: shaking-frame
title: Frame that shakes in a band of speeds
sort: physics
joins:
  - {gives: electric power, rises_with: n, law: law + P*exp(-((n - n0)/w)**2)}
drivers:
  n: {quantity: rotational speed}
parameters:
  P: {unit: W, null: 0, starts: [10], range: [-100, 100],
      usual: {median: 10, factor: 3, source: "[assumed]"}, title: power at its peak}
  n0: {unit: rpm, starts: [800], range: [100, 3000], title: speed at its peak}
  w: {unit: rpm, starts: [60], range: [5, 1000], title: width}
regime: a band of speeds
text: "{module}: shaking takes {P} near {n0}"
action: stiffen the frame
source: "[assumed]"
"""


def with_the_effect(folder: Path) -> Path:
    """A copy of the knowledge base that names what shakes."""
    shutil.copytree(ROOT / "kb", folder)
    (folder / "effects" / "shaking-frame.yaml").write_text(EFFECT.lstrip(), encoding="utf-8")
    return folder


def told(folder: Path, monkeypatch: pytest.MonkeyPatch, peak: float = 30.0) -> Mismatch:
    """The answer of a catalogue without the entry."""
    kb = with_the_effect(folder / "kb")
    monkeypatch.setenv("RULEC_KB", str(kb))
    given = tour(alone()[0], SAMPLES)
    built = {"A.shaking-frame@P_law": {"P": peak, "n0": 800.0 * RPM, "w": 60.0 * RPM}}
    recording = recorded(open_builder(PLANT), given, built, moved=False)
    (kb / "effects" / "shaking-frame.yaml").unlink()
    return compared(open_builder(PLANT), recording)


def bump(speed: Array) -> Array:
    """Unit shape of what is left out, at speeds in SI."""
    shape: Array = np.exp(-(((speed / RPM - 800.0) / 60.0) ** 2))
    return shape


def shape_in(found: Mismatch) -> tuple[Location, Shape]:
    location = max((at for at in found.locations if at.shape), key=lambda at: at.share)
    assert location.shape is not None
    return location, location.shape


def test_a_bump_without_a_name_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Verdict, place, driver, shape within its band, no memory, what lost, and what to do."""
    found = told(tmp_path, monkeypatch)
    assert "unnamed" == found.verdict
    location, shape = shape_in(found)
    assert ("A", "A.n") == (location.module, shape.driver)
    assert "P_law" in {location.place, *(place.partition(".")[2] for place in location.also)}
    true = 30.0 * bump(shape.at * RPM)
    # A curve of some eight independent values: 99 of 100 are within this, by chi-square.
    assert np.sqrt(np.mean(((shape.value - true) / shape.u) ** 2)) < np.sqrt(20.1 / 8.0)
    assert shape.text.startswith("a bump of ")
    assert not shape.monotone
    assert "yes" != shape.memory
    assert shape.beaten
    assert all(beaten.nats > 0.0 for beaten in shape.beaten)
    assert found.next.startswith(f"Look at what happens at A.{location.place} while A.n is from")
    assert "It follows A.n." in found.headline


def visits(seed: int = 1) -> tuple[Array, Array, Array]:
    """Speeds between 0 and 1 in any order, which way each was reached, and scatter."""
    random = np.random.default_rng(seed)
    speed = random.uniform(0.0, 1.0, 60)
    return speed, np.sign(np.diff(speed, prepend=0.5)), 0.3 * random.standard_normal(60)


@pytest.mark.parametrize("gap", [0.0, 4.0])
def test_a_gap_between_branches_is_found(gap: float) -> None:
    """Also where high speeds are mostly reached from below, so that a curve could take the gap."""
    speed, way, scatter = visits()
    assert np.corrcoef(speed, way)[0, 1] > 0.5
    left = 10.0 * np.exp(-(((speed - 0.5) / 0.2) ** 2)) + 0.5 * gap * way + scatter
    found, u = gap_between(left, way, 10.0 * Basis(0.0, 1.0, 0.1).at(speed))
    assert abs(found - gap) < 2.0 * u
    assert 0.0 < u < 0.5


def test_which_way_a_driver_came() -> None:
    """Noise is no move; what creeps moves in the end."""
    side, visit = ways_there(np.array([1.0, 1.01, 2.0, 2.01, 1.0, 1.0, np.nan, 3.0]), 0.001)
    assert [0, 0, 1, 1, -1, -1, -1, 1] == side.tolist()
    assert [0, 0, 1, 1, 2, 2, 2, 3] == visit.tolist()


@pytest.mark.parametrize(
    ("gap", "u", "expected"),
    [(10.0, 1.0, "yes"), (1.0, 1.0, "no"), (5.0, 3.0, "cannot be told"), (0.5, 0.1, "no")],
)
def test_memory_is_told_only_where_it_is_sure(gap: float, u: float, expected: str) -> None:
    """A gap counts from a fifth of the height of the curve on."""
    branches = Branches(gap=gap, u=u, rising=9, falling=8)
    assert expected == answer_of(branches, 30.0)


def test_the_machine_form_and_the_page_have_the_shape(drawn: Mismatch) -> None:
    """Rows of driver, value and uncertainty; the picture comes first."""
    (form,) = mismatch_form(drawn, "plant.yaml")["locations"]
    assert {"driver", "driver_unit", "unit", "points", "means", "text", "monotone"} == set(
        form["shape"]
    )
    assert [1.0, 2.0, 0.5] == form["shape"]["points"][0]
    assert {"answer": "no", "text": "because"} == form["memory"]
    assert [] == form["beaten"]
    leading = pictures_of(drawn, None)
    assert "shape0" == next(iter(leading)).name


@pytest.fixture
def drawn() -> Mismatch:
    """An answer by hand."""
    shape = Shape(
        driver="A.n",
        driver_unit="rpm",
        unit="W",
        at=np.array([1.0, 2.0]),
        value=np.array([2.0, 3.0]),
        u=np.array([0.5, 0.5]),
        means=np.array([[1.0, 2.0, 0.5]]),
        text="rises",
        monotone=True,
        memory="no",
        memory_text="because",
    )
    at = Location(
        module="A", place="P_law", title="", share=1.0, region=(), periods=(), shape=shape
    )
    plain = Mismatch(
        plant="p", title="p", recording="", verdict="unnamed", headline="", next="", seconds=0.0
    )
    return replace(plain, locations=(at,))
