"""Readings at which observers end (method.md, section 1.9, claim 19)."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from dataclasses import astuple

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.steady.evaluated_points import evaluate_part
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.parts import parts_of
from rulec_runtime.diagnosis.steady.verdict import why_blind
from rulec_runtime.diagnosis.trace import trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form, trace_csv

from rulec.prove.truth import TABLE_1, healthy_run, record
from tests.method.readings import built, noise_free, points, recording, ruleset

NAN = float("nan")
EDGES = {
    "pump at rest": ("abc", {"A.n [rpm]": 0.0}, {"A.pump", "A.power"}),
    "pump off": ("abc", {"A.n [rpm]": 0.0, "A.P_el [W]": 0.0}, {"A.pump", "A.power"}),
    "no pressure": ("abc", {"A.dp [bar]": 0.0}, {"A.pump", "A.power", "A.plant"}),
    "hardly any pressure": ("abc", {"A.dp [bar]": 0.04}, {"A.pump", "A.power", "A.plant"}),
    "just enough pressure": ("abc", {"A.dp [bar]": 0.06}, {"A.plant"}),
    "less than the static part": ("abc", {"A.dp [bar]": 0.40}, {"A.plant"}),
    "less than the mixer": ("abc", {"A.dp [bar]": 0.20}, {"A.plant"}),
    "no mixer pressure": ("abc", {"C.dp [bar]": 0.0}, {"C.resis"}),
    "negative mixer pressure": ("abc", {"C.dp [bar]": -0.01}, {"C.resis"}),
    "just above shut-off": ("abc-centrifugal", {"A.dp [bar]": 1.115}, {"A.pump", "A.power"}),
    "above shut-off": ("abc-centrifugal", {"A.dp [bar]": 1.3}, {"A.pump", "A.power"}),
    "no speed": ("abc", {"A.n [rpm]": NAN}, {"A.pump", "A.power"}),
    "no pump pressure": ("abc", {"A.dp [bar]": NAN}, {"A.pump", "A.power", "A.plant"}),
    "no mixer reading": ("abc", {"C.dp [bar]": NAN}, {"C.resis", "A.plant", "B.plant"}),
    "no power": ("abc", {"A.P_el [W]": NAN}, {"A.power"}),
    "infinite pressure": (
        "abc", {"A.dp [bar]": float("inf")}, {"A.pump", "A.power", "A.plant"},
    ),
    "all at rest": (
        "abc",
        {"A.n [rpm]": 0.0, "A.dp [bar]": 0.0, "A.P_el [W]": 20.0, "B.n [rpm]": 0.0,
         "B.dp [bar]": 0.0, "B.P_el [W]": 20.0, "C.dp [bar]": 0.0},
        {"A.pump", "A.power", "A.plant", "B.pump", "B.power", "B.plant", "C.resis"},
    ),
    "nothing at all": (
        "abc",
        dict.fromkeys(["A.n [rpm]", "A.dp [bar]", "A.P_el [W]", "B.n [rpm]", "B.dp [bar]",
                       "B.P_el [W]", "C.dp [bar]"], NAN),
        {"A.pump", "A.power", "A.plant", "B.pump", "B.power", "B.plant", "C.resis"},
    ),
}  # fmt: skip
"""Plant, readings that replace those of a healthy plant, observers that end."""
NO_WARNING = pytest.mark.filterwarnings("error::RuntimeWarning")
INFINITE = pytest.mark.filterwarnings("ignore:invalid value encountered in subtract")
"""Of `_stuck`; a recording read from a file has no infinite reading, the reader drops it."""


SILENT = ("pump at rest", "no pressure", "hardly any pressure", "no speed", "no pump pressure",
          "no mixer reading", "no power", "infinite pressure", "all at rest",
          "nothing at all")  # fmt: skip
"""Edges that contradict no other reading."""


@functools.cache
def edge_recording(edge: str, samples: int = 30) -> Recording:
    """A noisy healthy recording with the readings of an edge."""
    plant, replaced, _ = EDGES[edge]
    columns = dict(record(healthy_run(built(plant), samples), TABLE_1, seed=3).readings)
    noise = 1e-4 * np.random.default_rng(3).normal(size=samples)
    for name, value in replaced.items():
        columns[name] = value + noise * (value != 0.0)
    return recording(ruleset(plant), columns)


@functools.cache
def judged(edge: str, mode: str = "default") -> Diagnosis:
    """The diagnosis of an edge."""
    return diagnose(edge_recording(edge), ruleset(EDGES[edge][0]), mode)


def replaced_point(plant: str, columns: Mapping[str, float]) -> tuple[set[str], dict[str, float]]:
    """Invalid observers, and probabilities of faults, at one noise-free point."""
    rules = ruleset(plant)
    values = noise_free(plant)
    for signal in rules.signals:
        if f"{signal.id} [{signal.unit}]" in columns:
            shown = columns[f"{signal.id} [{signal.unit}]"]
            values[signal.id] = np.array([shown * signal.factor + signal.offset])
    observed = observe(rules, points(rules, values))
    ended = {o.id for o, ok in zip(rules.observers, observed.valid[:, 0], strict=True) if not ok}
    chances = isolate(rules, observed).probability[:, 0]
    return ended, {f.id: float(p) for f, p in zip(rules.faults, chances, strict=True)}


@pytest.mark.parametrize(
    "edge", [pytest.param(e, marks=INFINITE if "infinite" in e else NO_WARNING) for e in EDGES]
)
def test_observers_end(edge: str) -> None:
    """Exactly the observers without a value are set aside. In both modes every number in the output
    is finite, and what is missing is no fault."""
    plant, columns, expected = EDGES[edge]
    assert expected == replaced_point(plant, columns)[0]
    for mode in ("default", "paper"):
        json.dumps(diagnosis_form(judged(edge, mode)), allow_nan=False)
        table = trace_csv(trace(edge_recording(edge), ruleset(plant), mode))
        assert not {"nan", "inf", "-inf"} & set(table.replace("\n", ",").split(","))
        assert edge not in SILENT or not judged(edge, mode).findings


NOTHING_LEFT = {
    "all at rest": "A.n is below 40 rpm; A.dp is below 0.05 bar; B.n is below 40 rpm; "
    "B.dp is below 0.05 bar; C.resis gives no positive flow",
    "nothing at all": "A.n: no reading; A.dp: no reading; B.n: no reading; B.dp: no reading; "
    "C.dp: no reading",
}


@NO_WARNING
@pytest.mark.parametrize("edge", NOTHING_LEFT)
def test_cannot_judge(edge: str) -> None:
    """With nothing to compare the answer is 'cannot judge', with reasons."""
    found = judged(edge)
    assert ("C", 0) == (found.status, found.judged)
    assert (0.0, 29.0, NOTHING_LEFT[edge]) == astuple(found.not_judged[0])[:3]


PARTS = {
    "no pump pressure": "A.dp: no reading; cannot see A.leakage, A.clogging, A.widening, "
    "A.dp.high, ...",
    "no pressure": "A.dp: dead at zero; cannot see A.dp.high, A.dp.low",
    "no mixer reading": "C.dp: no reading; cannot see A.leakage, A.clogging, A.widening, "
    "B.leakage, ...",
    "no power": "A.P_el: no reading; cannot see A.P_el.high, A.P_el.low",
}
"""What the operator is told, beginning with the reading that brings back what cannot be seen."""


@NO_WARNING
@pytest.mark.parametrize("edge", PARTS)
def test_blind_module_is_named(edge: str) -> None:
    """The operator is told which part of the plant could not be judged, and why. A reading of zero
    is dead where others say that liquid flows."""
    found, dead = judged(edge), edge == "no pressure"
    assert ["A.dp.dead"] * dead == [sensor.id for sensor in found.sensors]
    back = PARTS[edge].partition(":")[0]
    assert [(0.0, 29.0, (back,))] == [(b.since, b.until, b.readings) for b in found.blind]
    assert ("F" if dead else "C") == found.status
    assert [(0.0, 29.0, f"in part: {PARTS[edge]}")] == [astuple(p)[:3] for p in found.not_judged]


@NO_WARNING
def test_a_dead_reading_that_others_stand_in_for_hides_nothing() -> None:
    """A pump at rest cannot lift liquid; how fast it turns, three other readings say."""
    found = judged("pump at rest")
    assert ("A.n.dead",) == tuple(sensor.id for sensor in found.sensors)
    assert ("F", (), ()) == (found.status, found.blind, found.not_judged)


def test_reasons_do_not_repeat_the_reading() -> None:
    """The same reason for every reading (SI), so neighbouring stretches join."""
    rules, readings = ruleset("abc"), [0.0, 2e3, 4.9e3]
    values = {name: np.repeat(v, 3) for name, v in noise_free("abc").items()}
    values["A.dp"] = np.array(readings)
    (part,) = parts_of(rules)
    seen = evaluate_part(rules, part, points(rules, values), "default")
    assert ["A.dp is below 0.05 bar"] * 3 == [why_blind(seen, i) for i in range(3)]


@NO_WARNING
def test_a_wrong_pressure_reading_is_not_blamed_on_others() -> None:
    """Above shut-off the true cause, a reading too high, stays possible; near 0 at nominal speed a
    reading says nothing certain about that of power."""
    assert replaced_point("abc-centrifugal", {"A.dp [bar]": 1.3})[1]["A.dp.high"] > 0.2
    for reading in (0.0, 0.06, 0.4):
        ended, chances = replaced_point("abc", {"A.dp [bar]": reading})
        assert "A.plant" in ended
        assert chances["A.P_el.high"] < 0.9
