"""Faults of a plant that stores: each from some time on."""

from dataclasses import replace

import pytest

from rulec.mismatch.answer.findings import findings_of, location_of
from rulec.mismatch.answer.written_plant import written
from rulec.mismatch.evidence.stores.fit import Fitter, fixed_values, plain_end
from rulec.mismatch.evidence.stores.model import model_of, period_of
from rulec.mismatch.result import Estimate
from rulec.mismatch.search.grow_sets import prune
from rulec.mismatch.search.simulated import begun
from rulec.mismatch.search.simulated import search as searched
from rulec.mismatch.stores import until_of
from tests.runtime.mismatch.dynamic.benches import TRUE, bench, explained, grow_by, joined_to, made

SINCE, DEGREE = 900.0, 0.15


def planted(fault: str) -> dict[str, float]:
    return {f"{fault}.x": DEGREE, f"{fault}.since": SINCE, f"{fault}.t_half": 1022.0}


@pytest.mark.parametrize("fault", ["lower.blockage", "upper.lost-inflow"])
def test_onset_and_degree_are_found(fault: str) -> None:
    place = bench(made(n=512, seed=5, joined=(fault,), more=planted(fault)))
    search = begun(place)
    grow_by(search, fault, "upper.area-slope@h")
    prune(search, search.likeliest)
    assert frozenset({fault}) == search.likeliest
    ends, plain = plain_end(place, search.models[frozenset()].setting.values)
    model = search.models[frozenset({fault})].setting
    found = ends.fitted(model.joined, {**model.values, **model.fixed}, plain)
    assert found.values[f"{fault}.since"] == pytest.approx(SINCE, abs=20.0)
    assert found.values[f"{fault}.x"] == pytest.approx(DEGREE, abs=0.03)


def test_a_strong_fault_is_as_sudden_as_it_was() -> None:
    """The rise that a search needs would shift its degree by many uncertainties."""
    fault, degree = "upper.blockage", 0.8
    sudden = {f"{fault}.x": degree, f"{fault}.since": SINCE + 1.0, f"{fault}.t_half": 20.0}
    place = bench(made(n=2048, seed=4, joined=(fault,), more=sudden))
    ends, plain, smooth = joined_to(place, fault, {**sudden, f"{fault}.t_half": 4094.0})
    found = ends.sharpened(smooth)
    assert found.values[f"{fault}.since"] == pytest.approx(SINCE + 1.0, abs=0.5)
    fitter = Fitter(place, found.joined, fixed_values(found))
    u = fitter.with_covariance(found, ends.judged).u(f"{fault}.x")
    assert abs(found.values[f"{fault}.x"] - degree) < 3.0 * u
    assert abs(smooth.values[f"{fault}.x"] - degree) > 10.0 * u
    assert ends.gain(found, plain) > ends.gain(smooth, plain)
    assert ends.sharpened(plain) is plain  # what begins nowhere stays as it is


def test_what_is_adopted_knows_the_fault_but_does_not_hold_it() -> None:
    """Values are fitted to what lies before the fault, which is no part of the model."""
    fault = "lower.blockage"
    recording = made(n=512, seed=4, joined=(fault,), more=planted(fault))
    place = bench(recording)
    ends, plain, found = joined_to(place, fault, planted(fault))
    said = explained(recording, place, ends, plain, found)
    model = written(said, said.proofs(()))[0]
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


@pytest.mark.prove
def test_a_fault_that_does_the_same_is_told_beside() -> None:
    """Whether a pump delivers less or a line loses it, a level further down says nothing of it."""
    fault = "upper.lost-inflow"
    place = bench(made(n=512, seed=4, joined=(fault,), more=planted(fault)))
    found = searched(place, lambda text: None)
    told = {c.id for own in found.accepted for c in (own.candidate, *(c for c, _ in own.others))}
    assert {fault, "pump.leakage", "pump.u.high"} <= told
    judged, best = found.ends.judged, found.best
    best = Fitter(place, best.joined, fixed_values(best)).with_covariance(best, judged)
    model = model_of(place, best, judged)
    (finding,) = findings_of(model, found.accepted)
    spots = {"upper.inflow", "pump.pump", "pump.u"}
    assert spots - {f"{finding.module}.{finding.place}"} == {*location_of(model, finding).also}
