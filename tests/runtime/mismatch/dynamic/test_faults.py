"""Faults of a plant that stores: each from some time on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rulec.mismatch.answer.tell import findings_of, location_of
from rulec.mismatch.answer.writable import writable
from rulec.mismatch.evidence.stores.drift import no_drift
from rulec.mismatch.evidence.stores.fit import Fitter, Judged
from rulec.mismatch.evidence.stores.model import model_of, period_of
from rulec.mismatch.result import Estimate
from rulec.mismatch.search.stores.backward_elimination import doubted
from rulec.mismatch.search.stores.nested_models import begun_alike
from rulec.mismatch.search.stores.onset_refinement import sharpened
from rulec.mismatch.search.stores.search import Found, search
from rulec.mismatch.search.stores.searcher import Searcher
from rulec.mismatch.stores import explanation, until_of
from tests.runtime.mismatch.dynamic.benches import NOISE, TRUE, bench, made, tanks

SINCE, DEGREE = 900.0, 0.15
FAULTS = ("lower.blockage", "upper.lost-inflow", "pump.u.high", "lower.y.low")


def planted(fault: str) -> dict[str, float]:
    return {f"{fault}.x": DEGREE, f"{fault}.since": SINCE, f"{fault}.t_half": 1022.0}


def test_every_fault_of_a_plant_that_stores_has_an_onset() -> None:
    """What is there from the beginning is a matter of calibration."""
    faults = [c for c in tanks()[1].candidates if c.sort == "fault"]
    assert {"lower.blockage", "upper.lost-inflow", "pump.leakage"} <= {c.id for c in faults}
    assert "upper.tank-leak@inflow" in {c.id for c in faults}
    assert all(c.onset is not None for c in faults)


@pytest.mark.parametrize("fault", FAULTS)
def test_before_its_onset_a_fault_does_nothing(fault: str) -> None:
    plain, broken = (
        made(joined=joined, more=more) for joined, more in (((), {}), ((fault,), planted(fault)))
    )
    change = np.abs(broken.values["lower.y"] - plain.values["lower.y"])
    before = plain.time < SINCE - 8.0
    assert change[before].max() < 0.002
    assert change[~before].max() > 10 * NOISE


@pytest.mark.parametrize("fault", ["lower.blockage", "upper.lost-inflow"])
def test_onset_and_degree_are_found(fault: str) -> None:
    """From starts all over the recording, to within a few samples."""
    place = bench(made(n=512, seed=5, joined=(fault,), more=planted(fault)))
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    plain = searcher.plain()
    candidate = place.candidate(fault)
    assert searcher.glance(plain, (candidate,)) > searcher.glance(
        plain, (place.candidate("upper.area-slope@h"),)
    )
    found = searcher.polished(searcher.trial(plain, (candidate,)))
    assert not found.pressed
    assert found.values[f"{fault}.since"] == pytest.approx(SINCE, abs=20.0)
    assert found.values[f"{fault}.x"] == pytest.approx(DEGREE, abs=0.03)


def test_a_strong_fault_is_as_sudden_as_it_was() -> None:
    """The rise that a search needs would shift its degree by many uncertainties."""
    fault, degree = "upper.blockage", 0.8
    sudden = {f"{fault}.x": degree, f"{fault}.since": SINCE + 1.0, f"{fault}.t_half": 20.0}
    place = bench(made(n=2048, seed=4, joined=(fault,), more=sudden))
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    plain = searcher.plain()
    smooth = searcher.polished(searcher.trial(plain, (place.candidate(fault),)))
    found = sharpened(searcher, smooth, plain)
    assert found.values[f"{fault}.since"] == pytest.approx(SINCE + 1.0, abs=0.5)
    fitter = Fitter(place, found.joined, searcher.kept(found))
    u = fitter.with_covariance(found, searcher.judged).u(f"{fault}.x")
    assert abs(found.values[f"{fault}.x"] - degree) < 3.0 * u
    assert abs(smooth.values[f"{fault}.x"] - degree) > 10.0 * u
    assert searcher.standing(found, plain) > searcher.standing(smooth, plain)


def test_what_begins_nowhere_stays_as_it_is() -> None:
    place = bench(made())
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    plain = searcher.plain()
    assert sharpened(searcher, plain, plain) is plain


def test_what_is_adopted_knows_the_fault_but_does_not_hold_it() -> None:
    """Values are fitted to what lies before the fault, which is no part of the model."""
    fault = "lower.blockage"
    recording = made(n=512, seed=4, joined=(fault,), more=planted(fault))
    place = bench(recording)
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    found = searcher.trial(searcher.plain(), (place.candidate(fault),))
    plain, judged = searcher.plain(), searcher.judged
    explained = explanation(
        recording,
        model_of(place, found, judged, searcher.kept(found)),
        Found(plain, found, judged, 1, {}),
    )
    model = writable(explained)
    adopted = model.repaired
    until = until_of(place, found, [place.candidate(fault)])
    assert found.values[f"{fault}.since"] == pytest.approx(until - place.record.time[0])
    assert [fault] == [name for name, _ in model.left_out]
    assert adopted.joined == ()
    assert not any(name.startswith(fault) for name in (*adopted.free, *adopted.values))
    assert (len(adopted.free), len(adopted.free)) == adopted.covariance.shape
    assert adopted.values["lower.a"] == pytest.approx(TRUE["lower.a"], rel=0.1)


def test_a_period_is_told_in_the_time_of_the_recording() -> None:
    recording = made()
    place = bench(replace(recording, time=recording.time + 5000.0))
    candidate = place.candidate("lower.blockage")
    found = {
        "x": Estimate("", 15.0, 1.0, 13.0, 17.0, "%"),
        "since": Estimate("", SINCE, 4.0, SINCE - 8, SINCE + 8, "s"),
    }
    (period,) = period_of(place, candidate, found)
    assert (5000.0 + SINCE, 5000.0 + 4.0 * 511) == (period.since, period.until)
    assert (0.15, 0.01) == (pytest.approx(period.degree), pytest.approx(period.u))


def test_faults_begin_when_the_best_of_them_does() -> None:
    """A fit that starts elsewhere may not find the way there."""
    first, second = "upper.lost-inflow", "upper.tank-leak@inflow"
    place = bench(made(n=512, seed=4, joined=(first,), more=planted(first)))
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    plain = searcher.plain()
    best, lost = (searcher.trial(plain, (place.candidate(f),)) for f in (first, second))
    lost = replace(lost, values={**lost.values, f"{second}.since": 1600.0, f"{second}.x": 0.01})
    found = {f.ids: f for f in begun_alike(searcher, [best], [best, lost], plain)}
    assert found[second,].values[f"{second}.since"] == pytest.approx(SINCE, abs=20.0)
    assert found[first,] is best


@pytest.mark.prove
def test_a_fault_that_does_the_same_is_told_beside() -> None:
    """Whether a pump delivers less or a line loses it, a level further down says nothing of it."""
    fault = "upper.lost-inflow"
    place = bench(made(n=512, seed=4, joined=(fault,), more=planted(fault)))
    found = search(place, lambda text: None)
    searcher = Searcher(place, found.judged, 2)
    best, accepted = doubted(searcher, found)
    told = {c.id for own in accepted for c in (own.candidate, *(c for c, _ in own.others))}
    assert {fault, "pump.leakage", "pump.u.high"} <= told
    best = Fitter(place, best.joined, searcher.kept(best)).with_covariance(best, found.judged)
    model = model_of(place, best, found.judged, searcher.kept(best))
    (finding,) = findings_of(model, accepted)
    spots = {"upper.inflow", "pump.pump", "pump.u"}
    assert spots - {f"{finding.module}.{finding.place}"} == {*location_of(model, finding).also}
