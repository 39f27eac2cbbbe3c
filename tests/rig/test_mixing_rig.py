"""The measuring of the rig: figures of a small run, and that the counting itself is right."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from rulec.prove.truth import RIGS, Plant
from tests.rig.isolation import __main__ as isolation
from tests.rig.mixing_rig.cases import EXPERIMENTS, FULL, PLANTS, QUICK
from tests.rig.mixing_rig.drawn import drawn
from tests.rig.mixing_rig.judge import Answer, Judged, Named, run
from tests.rig.mixing_rig.measure import counted, sample_figures, sound_form


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Judged]:
    """Every experiment, small."""
    folder: Path = tmp_path_factory.mktemp("rulesets")
    return {name: run(folder, make(QUICK), workers=1) for name, make in EXPERIMENTS.items()}


def test_answers_are_counted() -> None:
    """First, mentioned, surely wrong, unknown, silent; the bounds and errors of those named."""
    right = Named("A.leakage", 0.21, 0.15, 0.25, 1.0, ())
    narrow = Named("A.leakage", 0.23, 0.205, 0.25, 0.6, ())
    other = Named("B.leakage", 0.2, 0.1, 0.3, 0.6, ("A.leakage",))
    wrong = Named("B.leakage", 0.3, 0.1, 0.3, 0.99, ())
    said: list[tuple[Named, ...]] = [(right,), (narrow,), (other,), (wrong,), (), ()]
    answers = [
        Answer("by hand", "default", 1, 0.2, {"A.leakage": 0.2}, named, not number)
        for number, named in enumerate(reversed(said))
    ]
    found = counted(answers)
    names = ("first", "mentioned", "surely_wrong", "unknown", "silent", "covered")
    assert [(2, 6), (3, 6), (1, 6), (1, 6), (1, 6), (1, 2)] == [
        (found[name]["count"], found[name]["of"]) for name in names
    ]
    assert (0.02, 0.035) == pytest.approx((found["error"], found["error_any"]))


def test_size_of_the_full_runs() -> None:
    """At least 1200 stationary points of all faults, and 100,000 fault-free samples."""
    degrees, alarms = (EXPERIMENTS[name](FULL) for name in ("degrees", "alarms"))
    points = sum(len(task.plateaus) for task in degrees)
    healthy = sum(task.case.run.operation.time.size for task in alarms)
    assert (1376, 100_000) == (points, healthy)
    seeds = [task.case.seed for task in [*degrees, *alarms]]
    assert len(seeds) == len(set(seeds))
    sound = isolation.sound(isolation.Scale())
    assert 100_000 == sum(t.case.run.operation.time.size for t in sound)
    assert not any(t.case.faults for t in [*alarms, *sound])


def test_the_full_table_of_isolation() -> None:
    """540 recordings of abc, no seed twice, each fault and degree with ten calibrations; the fault
    begins with its plateau."""
    tasks = isolation.sound_start(isolation.Scale())
    assert 540 == len(tasks) == len({t.case.seed for t in tasks})
    cases: dict[str, set[int]] = {}
    for task in tasks:
        cases.setdefault(str(task.case.faults), set()).add(task.draw)
    assert {10} == {len(draws) for draws in cases.values()}
    ((start, _),) = tasks[0].plateaus
    degree = tasks[0].case.run.faults[next(iter(tasks[0].case.faults))]
    assert np.all(degree[:start] == 0.0)
    assert degree[start + 1] > 0.0


def test_leakage_is_measured(quick: dict[str, Judged]) -> None:
    """Default mode names every plateau of both plants, within 0.02, and alarms at no other time."""
    for plant in PLANTS:
        answers = [a for a in quick["leakage"].answers if a.group == plant]
        default = counted([a for a in answers if a.mode == "default"])
        assert (3, 3) == (default["points"], default["first"]["count"])
        assert default["error"] < 0.02
        samples = [s for s in quick["leakage"].samples if (s.group, s.mode) == (plant, "default")]
        assert 0.0 == sample_figures(samples, "A.leakage").alarmed


def test_healthy_rig_is_healthy(quick: dict[str, Judged]) -> None:
    """No sample of a tour with transients is called faulty in default mode."""
    found = sound_form([c for c in quick["alarms"].covered if c.mode == "default"])
    counts = (found["samples"], found["fault"]["count"], found["unknown"]["count"], found["named"])
    assert (80, 0, 0, []) == counts


def test_every_fault_answered_in_both_modes(quick: dict[str, Judged]) -> None:
    """Each plateau has one answer per mode; true degrees are what was set, to a valve's lag."""
    answers = quick["degrees"].answers
    tasks = EXPERIMENTS["degrees"](QUICK)
    assert [t.case.seed for t in tasks for _ in t.modes] == [a.case for a in answers]
    for one in answers:
        assert [one.set_degree] == pytest.approx(list(one.true.values()), rel=0.3)
    assert np.isfinite(counted(answers)["error"])


def test_the_command_gives_a_machine_form(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A recording of one fault."""
    arguments = "sound-start --repetitions 1 --degrees 0.3 --draws 1 --faults A.leakage --json -"
    monkeypatch.setattr(sys, "argv", ["isolation", *arguments.split()])
    isolation.main()
    form = json.loads(capsys.readouterr().out)["sound-start"]
    assert (1, 1) == (form["all"]["first"]["count"], form["all"]["first"]["of"])
    assert ["leakage 0.3"] == list(form["kind_and_degree"])


def test_a_drawn_plant_is_off_inside_its_uncertainty() -> None:
    """Another plant for each seed, the same for the same; what is exact stays."""
    plant = RIGS["abc"]()
    values = np.array([_numbers(drawn(plant, seed)) for seed in range(200)])
    assert np.array_equal(values[7], _numbers(drawn(plant, 7)))
    off = values / np.array(_numbers(plant)) - 1.0
    spread = off.std(axis=0)
    exact = [i for i, (name, _) in enumerate(_fields(plant)) if name == "volume"]
    assert [0.0] * len(exact) == spread[exact].tolist()
    varied = np.delete(np.arange(spread.size), exact)
    assert np.all(spread[varied] > 0)
    # The largest of 200 draws cut at two standard uncertainties; their spread is 0.88 of one.
    assert np.all(np.abs(off).max(axis=0)[varied] < 2.0 / 0.7 * spread[varied])


def _fields(plant: Plant) -> list[tuple[str, float]]:
    """Names and numbers that `drawn` may change, in one order."""
    found = []
    form = asdict(plant)
    for module in form["modules"].values():
        for part in (module["pump"], module["line"]):
            found += [(name, value) for name, value in part.items() if value]
    return found + [("quadratic", mixer["quadratic"]) for mixer in form["mixers"].values()]


def _numbers(plant: Plant) -> list[float]:
    return [value for _, value in _fields(plant)]
