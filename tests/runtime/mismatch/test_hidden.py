"""A driver that nobody recorded: its course in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.mismatch.search.latent_input import described, reconstruct
from rulec.mismatch.search.settled.best_set import search
from tests.runtime.mismatch.made import (
    USUAL,
    alone,
    compared,
    recorded,
    rows_at,
    tour,
    warming,
    without,
)
from tests.runtime.mismatch.warm import SAMPLES, SLIP, TRUE, run

TIME = np.arange(0.0, 3600.0, 10.0)
PHASE = TIME / TIME[-1]


@pytest.mark.parametrize(
    ("course", "expected"),
    [
        (np.full(len(TIME), 3.0), "constant"),
        (
            1.0 - np.exp(-TIME / 600.0),
            "slow, rises from the start, two thirds of the way within 10 min",
        ),
        (
            np.exp(-TIME / 600.0),
            "slow, falls from the start, two thirds of the way within 10 min",
        ),
        (np.sin(np.pi * PHASE) ** 2, "slow, turns 1 time over 60 min"),
        (-(np.sin(np.pi * PHASE) ** 2), "slow, turns 1 time over 60 min"),
        (np.sin(2 * np.pi * PHASE) ** 4, "slow, turns 3 times over 60 min"),
    ],
)
def test_a_course_in_words(course: Array, expected: str) -> None:
    """What rises, falls, turns or does nothing is told so, in either direction."""
    assert expected == described(TIME, course)


def test_what_rises_first_does_not_fall_from_the_start() -> None:
    """Two waves: up first, then down, and so on."""
    assert "falls from the start" not in described(TIME, np.sin(4 * np.pi * PHASE))


@pytest.mark.parametrize("factor", [1e-9, 1.0, 1e6])
def test_size_and_offset_do_not_matter(factor: float) -> None:
    """Turns are counted in shares of the span."""
    wave = np.sin(4 * np.pi * PHASE)
    assert described(TIME, wave) == described(TIME, 7.0 + factor * wave)


def test_small_wiggles_are_no_turns() -> None:
    """Only a third of the span counts."""
    course = PHASE + 0.02 * np.sin(200 * PHASE)
    assert "turns" not in described(TIME, course)


def test_a_return_during_stops_is_told() -> None:
    """Warms up, stands for an hour, is cold again."""
    time = np.concatenate([TIME, TIME + 9000.0])
    warm = 1.0 - np.exp(-TIME / 600.0)
    assert described(time, np.concatenate([warm, warm])).endswith("returns during stops")


@pytest.mark.parametrize(
    ("seconds", "expected"), [(60.0, "60 s"), (1800.0, "30 min"), (36000.0, "10.0 h")]
)
def test_spans_are_told_in_fitting_units(seconds: float, expected: str) -> None:
    """Seconds, minutes, hours."""
    time = np.linspace(0.0, seconds, 200)
    assert f"over {expected}" in described(time, np.sin(4 * np.pi * time / seconds))


def test_what_drives_a_slip_shows_in_its_parameter() -> None:
    """The pressure moves; an error that adds to the flow would have to move with it."""
    unrecorded = replace(run(), values={n: v for n, v in run().values.items() if n != "A.T"})
    found = search(rows_at(alone(), unrecorded), lambda text: None)
    (wandering,) = found.fitted.setting.joined
    assert wandering.id.startswith("parameter:A.C")
    assert wandering.place == "Q_geo"
    hidden = reconstruct(found.fitted, wandering.id)
    warm = np.interp(hidden.time, run().time, run().values["A.T"])
    assert abs(np.corrcoef(hidden.course, warm)[0, 1]) > 0.9


@pytest.mark.prove
def test_one_driver_behind_two_laws_is_told_at_both() -> None:
    """A temperature nobody recorded moves friction and slip: two courses that are alike."""
    built = {SLIP: TRUE[SLIP], "A.friction-temperature@P_law": {"b": 0.02, "T0": USUAL}}
    given = {**tour(alone()[0], SAMPLES), "A.T": warming(SAMPLES)}
    found = compared(alone(), without(recorded(alone(), given, built), "A.T"))
    assert found.verdict == "unnamed"
    assert not found.findings
    assert [where.place for where in found.locations] == ["P_law", "Q_geo"]
    assert sum(where.share for where in found.locations) == pytest.approx(1.0)
    assert found.hidden is not None
    assert "in A.Q_geo changes too, and its course correlates with this one by −0.9" in (
        found.hidden.text
    )
