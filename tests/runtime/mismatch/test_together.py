"""Several recordings in one analysis: own zeros, own clocks, own held-out parts, what changed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.recordings.join_recordings import together
from rulec_runtime.recordings.recording import Recording

from rulec.effects.candidate import TIME
from rulec.mismatch.answer.findings import of_recordings
from rulec.mismatch.evidence.configuration import ERROR, Configuration, own_error
from rulec.mismatch.evidence.model import HELDOUT
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence
from rulec.mismatch.evidence.steady.fit import prior_of
from rulec.mismatch.evidence.steady.operating_state_means import averaged
from rulec.mismatch.evidence.steady.repaired_model import repair_of, with_sensors_as_they_are
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.search.intermittent_fault import intermittent
from rulec.mismatch.search.later_refits import by_recording
from rulec.mismatch.search.operating_states import explain
from tests.runtime.mismatch.dynamic.problems import made, problem_of
from tests.runtime.mismatch.made import (
    DWELL,
    SLIP,
    USUAL,
    alone,
    changed,
    compared,
    fitted,
    loaded,
    prepared,
    recorded,
    rows_at,
    sampled,
    tour,
    warming,
)

PLANT = "abc"
SHIFT = 2.0
"""Standard uncertainties of its class by which a sensor is set anew between two recordings."""

LENGTH = 144
"""Samples of a recording."""


def joined(*parts: Recording, plant: str = PLANT) -> Recording:
    rules = alone()[0] if plant == "alone" else loaded(plant)[0]
    return together([Path(f"{i}.csv") for i in range(len(parts))], parts, rules)


def healthy(low: float = 0.6) -> Recording:
    plant = loaded(PLANT)
    return recorded(plant, tour(plant[0], LENGTH, low=low), moved=False)


def shifted(recording: Recording, name: str, by: float) -> Recording:
    u = float(np.median(rows_at(loaded(PLANT), recording).system.shared[name]))
    return changed(recording, {name: recording.values[name] + by * u})


@pytest.fixture(scope="module")
def rows() -> Rows:
    return rows_at(loaded(PLANT), joined(healthy(), healthy(0.65)))


def test_each_recording_has_its_own_held_out_part_means_and_clock(rows: Rows) -> None:
    """Zeros may be others in the next one."""
    both, plant = joined(healthy(), healthy(0.65)), loaded(PLANT)
    data = prepared(plant[0], both)
    first, second = (data.source == number for number in (0, 1))
    for here in (first, second):
        assert 0.1 < np.mean(data.part[here] == HELDOUT) < 0.3
    assert not set(data.block[first]) & set(data.block[second])
    means = averaged(rows.system, np.zeros(0))
    border = rows.system.data.time[rows.system.data.source == 1].min()
    assert np.array_equal(means.source == 1, means.time >= border)
    assert {0, 1} == set(means.source.tolist())
    own = np.asarray(rows.system.inputs[TIME])
    assert own[rows.system.data.source == 1].min() < 12.0
    assert own.max() < LENGTH
    dated = prepared(plant[0], replace(both, origin=None))
    assert np.array_equal(dated.clock, dated.time - dated.time[0])


def test_an_error_that_a_recording_has_as_its_own_shows_there_alone(rows: Rows) -> None:
    """The variances of both sum to the class of the sensor."""
    system = rows.system
    prior = prior_of(system, Configuration())
    variance = {n: 1.0 / prior.precision[i] for i, n in enumerate(prior.names) if ERROR in n}
    for name in system.shared:
        assert abs(variance[ERROR + name] + variance[own_error(name, 1)] - 1.0) < 1e-12
    evidence = SteadyEvidence(rows)
    source = system.data.source[evidence.point]
    ranks = [np.linalg.matrix_rank(evidence.moving[source == number]) for number in (0, 1)]
    assert min(ranks) > 0
    assert np.linalg.matrix_rank(evidence.moving) == sum(ranks)
    signal = next(iter(system.shared))
    names = [ERROR + signal, own_error(signal, 0), own_error(signal, 1)]
    by = system.flows(Configuration(), names).by_value
    assert by[names[0]]
    for i, whole in by[names[0]].items():
        first, second = (np.asarray(by[name][i]) for name in names[1:])
        assert not first[system.data.source == 1].any()
        assert not second[system.data.source == 0].any()
        assert np.allclose(first + second, whole, equal_nan=True)


@pytest.mark.parametrize("name", ["C.dp", "A.P_el"])
def test_a_zero_set_in_between_is_an_error_of_that_recording(name: str) -> None:
    """It costs what its class says; taken as one recording, it costs far more."""
    second = shifted(healthy(0.65), name, SHIFT)
    costs = {}
    for by, other in ((0.0, healthy(0.65)), (SHIFT, second)):
        both = joined(healthy(), other)
        one = replace(both, sources=(), source=None)
        for number, recording in enumerate((both, one)):
            found = fitted(loaded(PLANT), recording)
            costs[by, number] = found.objective
            if (by, number) == (SHIFT, 0):
                own = np.asarray(found.rows.system.error_at(name, found.setting))
                assert 0.6 * SHIFT < own[-1] - own[0] < 1.2 * SHIFT
    # Two numbers a standard deviation of sqrt(2 OWN_ERROR) apart: half the square of their
    # difference, and a little for all that moves with them.
    assert costs[SHIFT, 0] - costs[0.0, 0] < SHIFT**2
    assert costs[SHIFT, 1] - costs[0.0, 1] > 5.0 * (costs[SHIFT, 0] - costs[0.0, 0])


def test_values_to_be_written_do_not_follow_what_one_recording_has_as_its_own() -> None:
    """Compared with all taken as one recording."""
    name, moved = "A.P_el", {}
    for by in (0.0, SHIFT):
        both = joined(healthy(), shifted(healthy(0.65), name, by))
        for number, recording in enumerate((both, replace(both, sources=(), source=None))):
            found = with_sensors_as_they_are(fitted(loaded(PLANT), recording))
            shared = found.rows.system.shared
            assert all(found.setting.values[ERROR + own] == 0.0 for own in shared)
            repair = repair_of(found, found.covariance)
            moved[by, number] = np.array([c.value for c in repair.parameters])
    apart = [float(np.abs(moved[SHIFT, n] / moved[0.0, n] - 1.0).max()) for n in (0, 1)]
    assert apart[0] < 0.5 * apart[1]


def quiet(text: str) -> None:
    """Progress that nobody sees."""


@pytest.mark.prove
def test_a_recording_alone_says_what_it_says_when_asked_alone() -> None:
    """To the last digit; one with too little in it says nothing."""
    whole, plant = healthy(0.65), loaded(PLANT)
    short = sampled({n: v[:3] for n, v in whole.values.items()})
    both = joined(short, whole)
    rows = rows_at(plant, both)
    together, own = explain(rows, quiet), explain(rows_at(plant, whole), quiet)
    found = by_recording(both, rows.system, (), together, quiet)
    assert ["cannot judge", "none"] == [part.verdict for part in found.alone]
    likely = found.alone[1].likely[0]
    assert ("nothing", own.nothing) == (likely.id, likely.probability)
    (moved,) = found.moved[1]
    assert (None, together.nothing) == (moved.before, moved.after)
    told_of = of_recordings(both, rows, found)
    assert [("0.csv", 3), ("1.csv", LENGTH)] == [(part.name, part.rows) for part in told_of]
    assert 0.5 * LENGTH < told_of[1].used <= LENGTH
    assert by_recording(whole, rows.system, (), together, quiet) is None


def test_the_answer_tells_of_each_recording() -> None:
    """A slip that follows the temperature shows in the second alone."""
    plant, n = alone(), LENGTH // 2
    slip = {SLIP: {"b": 0.02, "T0": USUAL}}
    cold = recorded(plant, {**tour(plant[0], n), "A.T": np.full(n, USUAL)}, slip)
    warm = recorded(plant, {**tour(plant[0], n, low=0.65), "A.T": warming(n)}, slip)
    found = compared(plant, joined(cold, warm, plant="alone"))
    assert [("0.csv", "none"), ("1.csv", "ambiguous")] == [
        (r.name, r.verdict) for r in found.recordings
    ]
    (update,) = found.changed
    assert "1.csv" == update.recording
    assert ["nothing", SLIP] == [moved.id for moved in update.moved]
    before, after = np.array([(moved.before, moved.after) for moved in update.moved]).T
    assert before[0] > 0.9 > 0.1 > after[0]
    (finding,) = found.findings
    assert before[1] < 0.1 < 0.4 < after[1] == pytest.approx(finding.probability, abs=1e-3)
    assert SLIP == finding.id


def leaking() -> Recording:
    degree = np.where(np.arange(180) < 90, 0.0, 0.3)
    return recorded(alone(), tour(alone()[0], 180), {"A.leakage": {"x": degree}})


def test_a_run_has_a_clock_and_a_table_has_none() -> None:
    run = leaking()
    rows = np.arange(DWELL // 2, len(run), DWELL)
    table = sampled({name: v[rows] for name, v in run.values.items()})
    for recording, timed in ((run, True), (table, False)):
        system = rows_at(alone(), recording).system
        assert system.data.timed is timed
        assert system.data.of_rows is not timed
        assert any(c.follows_time for c in system.candidates) is timed
        assert system.candidates


def test_files_of_their_own_have_none() -> None:
    for one_clock in (True, False):
        found = fitted(alone(), replace(leaking(), one_clock=one_clock))
        assert one_clock == bool(list(intermittent(found, found.rows.system.candidates)))
        tanks = problem_of(replace(made(), one_clock=one_clock))
        assert one_clock == any(c.follows_time for c in tanks.candidates)


def test_the_answer_says_so() -> None:
    found = compared(alone(), replace(leaking(), one_clock=False))
    assert any("no common time" in note for note in found.notes)
    assert found.latent_input is None
    assert not any(f.periods for f in found.findings)
    assert not any(place.periods for place in found.locations)
