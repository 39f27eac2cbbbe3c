"""What has no name is told with its shape, and with memory; never beside a law that it holds."""

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import read_recording

from rulec.effects.candidate import DisturbanceLocation
from rulec.effects.model_builder import open_builder
from rulec.language import expression
from rulec.language.limits import MAX_EQUATION_LENGTH
from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.shapes import answer_of
from rulec.mismatch.answer.terminal_and_page import pictures_of
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.term import Basis, Term, basis_over, ways_there
from rulec.mismatch.search.curve_at_points import gap_between
from rulec.mismatch.search.curve_found import Branches
from rulec.mismatch.search.operating_states import begun, with_term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.scan import beside, holds
from tests.conftest import ROOT
from tests.runtime.mismatch.made import alone, compared, recorded, rows_at, tour

RPM, PEAK = 1.0 / 60.0, 30.0
PLANT = Path(__file__).parent / "plant.yaml"
EFFECT = """\
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


def test_a_bump_without_a_name_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RULEC_KB", str(shutil.copytree(ROOT / "kb", tmp_path / "kb")))
    entry = tmp_path / "kb" / "effects" / "shaking-frame.yaml"
    entry.write_text(EFFECT, encoding="utf-8")
    built = {"A.shaking-frame@P_law": {"P": PEAK, "n0": 800.0 * RPM, "w": 60.0 * RPM}}
    recording = recorded(open_builder(PLANT), tour(alone()[0], 360), built, moved=False)
    entry.unlink()
    found = compared(open_builder(PLANT), recording)
    assert "unnamed" == found.verdict
    location = max((at for at in found.locations if at.shape), key=lambda at: at.share)
    shape = location.shape
    assert ("A", "A.n") == (location.module, shape.driver)
    assert "P_law" in {location.place, *(place.partition(".")[2] for place in location.also)}
    off = (shape.value - PEAK * np.exp(-(((shape.at - 800.0) / 60.0) ** 2))) / shape.u
    # A curve of some eight independent values: 99 of 100 are within this, by chi-square.
    assert np.sqrt(np.mean(off**2)) < np.sqrt(20.1 / 8.0)
    assert shape.text.startswith("a bump of ")
    assert not shape.monotone
    assert "yes" != shape.memory
    assert shape.beaten
    assert all(beaten.nats > 0.0 for beaten in shape.beaten)
    assert found.next.startswith(f"Look at what happens at A.{location.place} while A.n is from")
    assert "It depends on A.n." in found.headline
    form = next(f for f in mismatch_form(found, "plant.yaml")["locations"] if "shape" in f)
    keys = {"driver", "driver_unit", "unit", "points", "means", "text", "monotone"}
    assert keys == set(form["shape"])
    assert [shape.at[0], shape.value[0], shape.u[0]] == pytest.approx(form["shape"]["points"][0])
    assert {"answer", "text"} == set(form["memory"])
    assert len(shape.beaten) == len(form["beaten"])
    assert "shape0" == pictures_of(found, None)[0].name


@pytest.mark.parametrize("gap", [0.0, 4.0])
def test_a_gap_between_branches_is_found(gap: float) -> None:
    """Also where high speeds are mostly reached from below, so that a curve could take the gap."""
    random = np.random.default_rng(1)
    speed = random.uniform(0.0, 1.0, 60)
    way, scatter = np.sign(np.diff(speed, prepend=0.5)), 0.3 * random.standard_normal(60)
    assert np.corrcoef(speed, way)[0, 1] > 0.5
    left = 10.0 * np.exp(-(((speed - 0.5) / 0.2) ** 2)) + 0.5 * gap * way + scatter
    found, u = gap_between(left, way, 10.0 * Basis(0.0, 1.0, 0.1).at(speed))
    assert abs(found - gap) < 2.0 * u
    assert 0.0 < u < 0.5


def test_memory_is_told_only_where_it_is_sure() -> None:
    """A gap counts from a fifth of the height of the curve on."""
    for gap, u, expected in (
        (10.0, 1.0, "yes"),
        (1.0, 1.0, "no"),
        (5.0, 3.0, "cannot be told"),
        (0.5, 0.1, "no"),
    ):
        assert expected == answer_of(Branches(gap=gap, u=u, rising=9, falling=8), 30.0)
    side, visit = ways_there(np.array([1.0, 1.01, 2.0, 2.01, 1.0, 1.0, np.nan, 3.0]), 0.001)
    assert [0, 0, 1, 1, -1, -1, -1, 1] == side.tolist()
    assert [0, 0, 1, 1, 2, 2, 2, 3] == visit.tolist()


def test_a_curve_has_fewer_pieces_where_its_equation_is_too_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two curves in one module have longer names, and may pass what an equation may hold."""
    plant = ROOT / "plants" / "abc"

    def begin() -> Rows:
        opened = open_builder(plant)  # a new plant: what was built once is kept
        return rows_at(opened, read_recording(plant / "examples" / "shaking_B.csv", opened[0]))

    start = begun(begin())
    every = start.evidence.terms(start.models[frozenset()].point)
    term = next(t for t in every if t.name == "definition:B.P_law~B.n")
    pieces = []
    for longest in (MAX_EQUATION_LENGTH, MAX_EQUATION_LENGTH * 3 // 4, 10):
        rows = begin()
        fitted = fit(rows, Configuration(), rows.system.data.open, 1)
        assert rows.system.builder.spots
        monkeypatch.setattr(expression, "MAX_EQUATION_LENGTH", longest)
        joined = with_term(fitted, term)
        monkeypatch.undo()
        added = () if joined is None else joined.setting.joined[-1].unknowns
        pieces.append(sum(u.null is not None for u in added))
    assert pieces[0] > pieces[1] > pieces[2] == 0


DRIVER = np.linspace(0.0, 1.0, 200)
SLOPES = 1.0 + 0.5 * np.sin(np.arange(200.0))
"""How an error at the place shows in each row."""

SMOOTH = SLOPES * np.exp(-1.5 * DRIVER)
"""A law that follows the driver of the term, at its place, as slip does a temperature."""

BAND = SLOPES * np.exp(-(((DRIVER - 0.5) / 0.1) ** 2))
"""A law that shows in a band of that driver alone."""

ELSEWHERE = np.cos(7.0 * np.arange(200.0))
"""A law that follows something else."""


def term(name: str = "Q_law~T", driver: Array = DRIVER, length: float = 0.4) -> Term:
    """A term over a driver, of which each row has a value."""
    basis, spot = basis_over(driver, length), cast(DisturbanceLocation, None)
    columns = SLOPES[:, None] * basis.at(driver)
    return Term(name, "Q_law", spot, "T", SLOPES, basis, 1.0, columns)


def model(laws: dict[str, Array], terms: tuple[Term, ...] = ()) -> Model:
    """A model with one law, by the slopes of its unknowns; those with a null are strengths."""
    unknowns = [SimpleNamespace(id=n, null=0.0 if n.startswith("k") else None) for n in laws]
    fake = SimpleNamespace(
        setting=SimpleNamespace(joined=[SimpleNamespace(unknowns=unknowns)] if laws else []),
        prior=SimpleNamespace(names=tuple(laws)),
        raw=np.stack([*laws.values()], axis=1) if laws else np.zeros((len(DRIVER), 0)),
        terms=terms,
    )
    return cast(Model, fake)


def test_a_term_holds_what_is_a_special_case_of_it() -> None:
    """Up to a law's own error of form; what happens in a band is more than a smooth term can be."""
    assert holds([term()], SMOOTH)
    assert holds([term()], SMOOTH + 0.02 * ELSEWHERE)
    for law in (SMOOTH + 0.2 * ELSEWHERE, BAND, ELSEWHERE):
        assert not holds([term()], law)
    assert holds([term(length=0.1)], BAND)
    assert not holds([], SMOOTH)


def test_a_term_is_told_beside_a_law_that_it_does_not_hold() -> None:
    """A threshold whose slope looks like a term leaves that open."""
    shaped = {"x": SMOOTH, "k": ELSEWHERE, "k2": np.zeros(len(DRIVER))}
    for laws, told in (({"k": SMOOTH}, 0), ({"k": ELSEWHERE}, 1), (shaped, 1)):
        assert told == len(beside(model(laws), [term()]))


def test_a_term_that_shows_alike_is_not_told_twice() -> None:
    """A smooth term is a special case of a rough one over the same driver."""
    rough, smooth = term("rough", length=0.1), term("smooth")
    other = term("other", driver=np.sin(3.0 * np.arange(200.0)))
    for first, second in ((rough, smooth), (smooth, rough)):
        assert ["other"] == [t.name for t in beside(model({}, (first,)), [second, other])]
