"""What has no name: its shape and memory, beside which laws it is told; what was once misnamed."""

from dataclasses import replace
from math import comb
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.effects.candidate import DisturbanceLocation
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.language import expression
from rulec.language.limits import MAX_EQUATION_LENGTH
from rulec.mismatch.analyse import analyse
from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.pictures import pictures_of
from rulec.mismatch.answer.shapes import answer_of
from rulec.mismatch.answer.verdict import next_step
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.term import Basis, Switching, Term, basis_over, ways_there
from rulec.mismatch.search.curve_at_points import gap_between
from rulec.mismatch.search.curve_found import Branches
from rulec.mismatch.search.grow_sets import join_terms
from rulec.mismatch.search.later_refits import possible_sets, refitted_again
from rulec.mismatch.search.operating_states import begun, explain, search, with_term
from rulec.mismatch.search.posterior import Posterior
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.scan import beside, coincide, holds
from rulec.mismatch.search.time_course import penalty_of
from rulec.prove.truth.settled.plan import Planned, SettledCase
from tests.conftest import ROOT
from tests.dosing.runs import taken
from tests.runtime.mismatch.made import alone, compared, recorded, rows_at, tour
from tests.runtime.mismatch.made import loaded as load
from tests.runtime.mismatches import UNNAMED

PLANT = Path(__file__).parent / "plant.yaml"


def test_a_bump_without_a_name_is_told() -> None:
    """A frame that shakes in a band of speeds and takes power, by the independent truth."""
    plant = load("abc")
    recording = read_recording(ROOT / "plants/abc/examples/shaking_B.csv", plant[0])
    found = compared(plant, recording)
    assert "unnamed" == found.verdict
    location = max((at for at in found.locations if at.shape), key=lambda at: at.share)
    shape = location.shape
    assert ("B", "B.n") == (location.module, shape.driver)
    assert "P_law" in {location.place, *(place.partition(".")[2] for place in location.also)}
    off = (shape.value - taken(shape.at / 60.0)) / shape.u
    # A curve of some eight independent values: 99 of 100 are within this, by chi-square.
    assert np.sqrt(np.mean(off**2)) < np.sqrt(20.1 / 8.0)
    assert shape.text.startswith("a bump of ")
    assert not shape.monotone
    assert "yes" != shape.memory
    assert shape.beaten
    assert all(beaten.nats > 0.0 for beaten in shape.beaten)
    assert found.next.startswith(f"Look at what happens at B.{location.place} while B.n is from")
    assert "It depends on B.n." in found.headline
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
        loaded = open_builder(plant)  # a new plant: what was built once is kept
        return rows_at(loaded, read_recording(plant / "examples" / "shaking_B.csv", loaded[0]))

    first = begin()
    start = begun(first)
    every = start.evidence.terms(start.models[frozenset()].point)
    term = next(t for t in every if t.name == "definition:B.P_law~B.n")
    pieces = []
    for longest in (MAX_EQUATION_LENGTH, MAX_EQUATION_LENGTH * 3 // 4, 10):
        rows = begin() if pieces else first
        fitted = fit(rows, Configuration(), rows.system.data.open, 1)
        assert rows.system.builder.locations
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
    basis, location = basis_over(driver, length), cast(DisturbanceLocation, None)
    columns = SLOPES[:, None] * basis.at(driver)
    return Term(name, "Q_law", location, "T", SLOPES, basis, 1.0, columns)


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


def test_a_term_is_told_beside_a_law_that_is_no_special_case_of_it() -> None:
    """Up to the law's own error of form; what happens in a band is more than a smooth term can be.
    A threshold whose slope looks like a term leaves that open."""
    shaped = {"x": SMOOTH, "k": ELSEWHERE, "k2": np.zeros(len(DRIVER))}
    near, far = ({"k": SMOOTH + share * ELSEWHERE} for share in (0.02, 0.2))
    for laws in ({"k": ELSEWHERE}, far, {"k": BAND}, shaped):
        assert 1 == len(beside(model(laws), [term()]))
    for laws, length in (({"k": SMOOTH}, 0.4), (near, 0.4), ({"k": BAND}, 0.1)):
        assert [] == beside(model(laws), [term(length=length)])
    assert not holds([], SMOOTH)


def test_a_term_that_shows_alike_is_not_told_twice() -> None:
    """A smooth term is a special case of a rough one over the same driver."""
    rough, smooth = term("rough", length=0.1), term("smooth")
    other = term("other", driver=np.sin(3.0 * np.arange(200.0)))
    for first, second in ((rough, smooth), (smooth, rough)):
        assert ["other"] == [t.name for t in beside(model({}, (first,)), [second, other])]


def case(effect: str, aim: float = 3000.0) -> SettledCase:
    return Planned(f"concealed {effect}", "single", "dosing", "steps", (effect,), aim).make()


def loaded(made: SettledCase, folder: Path) -> tuple[Recording, Ruleset, ModelBuilder]:
    made.write(folder)
    ruleset, builder = open_builder(folder / "plant")
    return read_recording(folder / "recording.csv", ruleset), ruleset, builder


@pytest.mark.prove
@pytest.mark.parametrize(
    ("effect", "verdict", "name"),
    [
        ("leak", "fault", "leakage"),  # it may be there for longer than it is not
        ("clogged", "fault", "clogging"),  # a driver may turn about when it begins
        ("slip-laminar", "named", "slip-linear"),  # more than stated values can make room for
        ("wear", "named", "wear-slip"),  # a time constant that is not needed
        ("power-gain-creep", "ambiguous", "slope"),  # laws may be off by as much
    ],
)
def test_what_was_planted_is_named(effect: str, verdict: str, name: str, tmp_path: Path) -> None:
    made = case(effect)
    found = analyse(*loaded(made, tmp_path))
    module = made.answer.effects[0].module
    assert verdict == found.verdict
    assert [(name, module)] == [(f.name, f.module) for f in found.findings]


@pytest.mark.prove
def test_two_of_which_each_imitates_the_other_for_a_while(tmp_path: Path) -> None:
    """Each alone gains in some blocks and does harm in others."""
    name, effects = "stationary-718873036-pair-fouling+leak-0", ("fouling", "leak")
    made = Planned(name, "pair", "dosing", "ramps", effects, 4241.729764785293).make()
    recording, ruleset, builder = loaded(made, tmp_path)
    found = search(rows_at((ruleset, builder), recording), lambda text: None)
    modules = {a.candidate.name: a.candidate.module for a in found.accepted}
    assert {"leakage": "B", "fouling": "B"} == modules
    assert all(a.probability > 0.9 for a in found.accepted)


def rows_of(group: str, effect: str, folder: Path) -> Rows:
    """A small case with one effect that no entry has, or whose driver is not recorded."""
    case = Planned("a case", group, "dosing", "steps", (effect,), 3000.0, small=True)
    recording, ruleset, builder = loaded(case.make(), folder)
    return rows_at((ruleset, builder), recording)


def with_terms(rows: Rows, location: str) -> Posterior:
    search = begun(rows)
    ids = {s.id for s in rows.system.builder.locations if f"{s.module}.{s.place}" == location}
    every = search.evidence.terms(search.models[frozenset()].point)
    join_terms(search, frozenset(), [t for t in every if t.location in ids])
    return search.posterior()


def share(found: Posterior, mark: str) -> float:
    """Probability that a set has a name with some mark."""
    return sum(p for names, p in found.sets.items() if any(mark in name for name in names))


def test_friction_by_the_way_there_is_told_as_that(tmp_path: Path) -> None:
    """No experiment is planned with it: what it does at other set points is unknown."""
    rows = rows_of("unnamed", "play", tmp_path)
    found = with_terms(rows, "A.loss")
    (term,) = found.models[found.best].terms
    assert "a law with memory" in term.basis.says
    sets = possible_sets(found)
    assert term.basis.says in sets[0].titles[0]
    assert sets[0] not in refitted_again(rows, sets).sets


def test_a_driver_that_turns_is_told_as_a_course(tmp_path: Path) -> None:
    found = with_terms(rows_of("unrecorded", "friction-warm", tmp_path), "A.P_law")
    assert share(found, "~time") > 0.9


@pytest.mark.prove
@pytest.mark.parametrize(
    ("group", "effect"),
    [("unnamed", "play"), ("unnamed", "pattern"), ("unrecorded", "friction-warm")],
)
def test_none_is_told_as_a_fault(group: str, effect: str, tmp_path: Path) -> None:
    found = explain(rows_of(group, effect, tmp_path), lambda text: None)
    assert share(found, "~time") > 0.9
    assert share(found, "!") < 0.1


def test_a_level_lasts_until_the_next_end() -> None:
    """Which of some borders are ends is as dear as telling them."""
    assert penalty_of(4, 10) == pytest.approx(np.log(comb(10, 4) * 11))
    way = Switching(np.array([10.0, 20.0]), np.array([0.0, 1.0, -1.0]), "says", 0.0)
    assert way.at(np.array([5.0, 10.0, 19.0, 20.0]))[:, 0].tolist() == [0.0, 1.0, 1.0, -1.0]


def test_who_reads_it_is_sent_to_the_set_points_not_to_a_sensor() -> None:
    said = next_step("unnamed", (), replace(UNNAMED.latent_input, switches=True), ())
    assert "from below and from above" in said
    assert "Record what may drive it" not in said


HERE, THERE = np.array([1.0, 2.0, 3.0]), np.array([1.0, 0.0, -1.0])
NOTHING = np.zeros(3)


def with_amplitude(column: Array) -> Any:
    """A model with a single amplitude."""
    table: dict[str, Any] = dict.fromkeys(("raw", "table"), column[:, None])
    prior = SimpleNamespace(names=("a",))
    return SimpleNamespace(**table, noise=1.0, weights=np.ones(3), precision=np.eye(1), prior=prior)


@pytest.mark.parametrize(
    ("own", "other", "same"),
    [
        (HERE, 2.0 * HERE, True),
        (HERE, THERE, False),
        (HERE, NOTHING, False),
        (NOTHING, HERE, False),
        (NOTHING, NOTHING, True),
    ],
)
def test_explanations_coincide(own: Any, other: Any, same: bool) -> None:
    evidence: Any = SimpleNamespace(whitened=lambda rows, noise: rows)
    law: Any = SimpleNamespace(unknowns=[SimpleNamespace(id="a", null=0.0)])
    assert coincide(evidence, with_amplitude(own), law, with_amplitude(other), law) is same


def test_a_reading_is_rarely_off_by_more_than_usual() -> None:
    """An error of a reading that no entry names is hardly larger than those that have a name; a law
    may be off by anything."""
    start = begun(rows_at(open_builder(PLANT), recorded(alone(), tour(alone()[0], 120))))
    terms = start.evidence.terms(start.models[frozenset()].point)
    of_readings = [t for t in terms if t.changed.kind == "signal"]
    assert of_readings
    for term in of_readings:
        assert 0.0 < term.usual < np.inf
        assert term.odds(0.5 * term.usual) == term.odds(term.usual) == 0.0
        assert term.odds(term.usual * term.factor) == pytest.approx(-0.5)
    assert {0.0} == {t.odds(1e6) for t in terms if t.changed.kind == "definition"}


@pytest.mark.parametrize(
    ("behind", "expected"), [(2.0, "definition:A.P_law"), (2.5, "signal:A.P_el")]
)
def test_of_places_that_fit_alike_one_that_a_plant_can_hold_is_told(
    behind: float, expected: str
) -> None:
    where = {s.id: s for s in alone()[1].locations}
    reading, law = (
        SimpleNamespace(name=f"{place}~A.n", changed=where[place], driver="A.n")
        for place in ("signal:A.P_el", "definition:A.P_law")
    )
    models = {frozenset({t.name}): SimpleNamespace(terms=(t,)) for t in (reading, law)}
    odds = dict(zip(models, (20.0, 20.0 - behind), strict=True))
    every = {frozenset[str](): SimpleNamespace(terms=()), **models}
    found = Posterior(cast("Any", None), cast("Any", every), {frozenset(): 0.0, **odds})
    assert {f"{expected}~A.n"} == found.selected
