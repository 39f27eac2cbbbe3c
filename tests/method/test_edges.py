"""Readings at which observers end (method.md, section 1.9, claim 19)."""

import functools
import json
from collections.abc import Mapping

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.evaluated_points import evaluate_part
from rulec_runtime.diagnosis.steady.independent_parts import parts_of
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.verdict import why_blind
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form, trace_csv

from tests.dosing import TABLE_1, healthy_run, record
from tests.method.readings import built, chances, noise_free, points, recording, ruleset, to_si

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


@functools.cache
def edge_recording(edge: str, samples: int = 30) -> Recording:
    """A noisy healthy recording with the readings of an edge."""
    plant, replaced, _ = EDGES[edge]
    columns = dict(record(healthy_run(built(plant), samples), TABLE_1, seed=3).readings)
    noise = 1e-4 * np.random.default_rng(3).normal(size=samples)
    for name, value in replaced.items():
        columns[name] = value + noise * (value != 0.0)
    return recording(ruleset(plant), columns)


def replaced_point(plant: str, columns: Mapping[str, float]) -> tuple[set[str], dict[str, float]]:
    """Invalid observers, and probabilities of faults, at one noise-free point."""
    rules, shown = ruleset(plant), {name: np.array([v]) for name, v in columns.items()}
    values = noise_free(plant) | to_si(rules, shown)
    valid = observe(rules, points(rules, values)).valid[:, 0]
    ended = {o.id for o, ok in zip(rules.observers, valid, strict=True) if not ok}
    return ended, chances(plant, values)


@pytest.mark.parametrize(
    "edge", [pytest.param(e, marks=INFINITE if "infinite" in e else NO_WARNING) for e in EDGES]
)
def test_observers_end(edge: str) -> None:
    """Exactly the observers without a value are set aside. In both modes every number in the output
    is finite."""
    plant, columns, expected = EDGES[edge]
    assert expected == replaced_point(plant, columns)[0]
    for mode in ("default", "paper"):
        found = diagnose(edge_recording(edge), ruleset(plant), mode)
        json.dumps(diagnosis_form(found), allow_nan=False)
        table = trace_csv(trace(edge_recording(edge), ruleset(plant), mode))
        assert not {"nan", "inf", "-inf"} & set(table.replace("\n", ",").split(","))


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
        ended, found = replaced_point("abc", {"A.dp [bar]": reading})
        assert "A.plant" in ended
        assert found["A.P_el.high"] < 0.9
