"""The counting of isolation: tables, draws, and the command in small."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict

import numpy as np
import pytest

from rulec.prove.truth import RIGS, Plant, drawn
from tests.rig.isolation.__main__ import main
from tests.rig.isolation.count import counted
from tests.rig.isolation.tables import TABLES, Scale, sound
from tests.rig.mixing_rig.judge import Answer, Named


def answer(fault: str, *named: Named) -> Answer:
    """An answer by hand, its true degree 0.2."""
    return Answer("abc", "by hand", "default", 1, 0.2, {fault: 0.2}, named, False)


def test_answers_are_counted() -> None:
    """First, mentioned, surely wrong, silent; the bounds of those named first."""
    right = Named("A.leakage", 0.21, 0.15, 0.25, 1.0, ())
    narrow = Named("A.leakage", 0.21, 0.205, 0.25, 0.6, ())
    other = Named("B.leakage", 0.2, 0.1, 0.3, 0.6, ("A.leakage",))
    wrong = Named("B.leakage", 0.2, 0.1, 0.3, 0.99, ())
    said: list[tuple[Named, ...]] = [(right,), (narrow,), (other,), (wrong,), ()]
    found = counted([answer("A.leakage", *named) for named in said])
    names = ("first", "mentioned", "surely_wrong", "silent", "covered")
    assert [(2, 5), (3, 5), (1, 5), (1, 5), (1, 2)] == [
        (found[name]["count"], found[name]["of"]) for name in names
    ]


@pytest.mark.parametrize("name", TABLES)
def test_a_full_table(name: str) -> None:
    """540 recordings of abc, no seed twice, each fault and degree with ten calibrations."""
    tasks = TABLES[name].tasks(Scale())
    assert 540 == len(tasks) == len({t.case.seed for t in tasks})
    cases: dict[str, set[int]] = {}
    for task in tasks:
        cases.setdefault(str(task.case.faults), set()).add(task.draw)
    assert {10} == {len(draws) for draws in cases.values()}
    start = min(first for first, _ in tasks[0].plateaus)
    fault = next(iter(tasks[0].case.faults))
    degree = tasks[0].case.run.faults[fault]
    assert (start == 0) == (degree[0] > 0)
    assert np.all(degree[:start] == 0)


def test_sound_recordings_reach_their_number() -> None:
    """100,000 samples, none with a fault."""
    tasks = sound(Scale())
    assert 100_000 == sum(t.case.run.operation.time.size for t in tasks)
    assert not any(t.case.faults for t in tasks)


def test_a_drawn_plant_is_off_inside_its_uncertainty() -> None:
    """Another plant for each seed, the same for the same; what is exact stays."""
    plant = RIGS["abc"]()
    values = np.array([_numbers(drawn(plant, seed)) for seed in range(200)])
    assert np.array_equal(values[7], _numbers(drawn(plant, 7)))
    off = values / np.array(_numbers(plant)) - 1.0
    spread = off.std(axis=0)
    exact = [i for i, name in enumerate(_names(plant)) if name == "volume"]
    assert [0.0] * len(exact) == spread[exact].tolist()
    varied = np.delete(np.arange(spread.size), exact)
    assert np.all(spread[varied] > 0)
    # The largest of 200 draws cut at two standard uncertainties; their spread is 0.88 of one.
    assert np.all(np.abs(off).max(axis=0)[varied] < 2.0 / 0.7 * spread[varied])


def test_the_command_gives_a_machine_form(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two recordings of one fault, with `--json -`: figures alone on standard output."""
    arguments = "sound-start --repetitions 1 --degrees 0.3 --draws 1 --faults A.leakage --json -"
    monkeypatch.setattr(sys, "argv", ["isolation", *arguments.split()])
    main()
    form = json.loads(capsys.readouterr().out)["sound-start"]
    assert (1, 1) == (form["all"]["first"]["count"], form["all"]["first"]["of"])
    assert ["leakage 0.3"] == list(form["kind_and_degree"])


def _fields(plant: Plant) -> list[tuple[str, float]]:
    """Names and numbers that `drawn` may change, in one order."""
    found = []
    form = asdict(plant)
    for module in form["modules"].values():
        for part in (module["pump"], module["line"]):
            found += [(name, value) for name, value in part.items() if value]
    return found + [("quadratic", mixer["quadratic"]) for mixer in form["mixers"].values()]


def _names(plant: Plant) -> list[str]:
    return [name for name, _ in _fields(plant)]


def _numbers(plant: Plant) -> list[float]:
    return [value for _, value in _fields(plant)]
