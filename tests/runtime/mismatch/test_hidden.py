"""A driver that nobody recorded: its place, and its course in words."""

from __future__ import annotations

import numpy as np
import pytest

from rulec.mismatch.search.latent_input import described, reconstruct
from rulec.mismatch.search.settled.best_set import search
from tests.runtime.mismatch.made import SLIP, USUAL, alone, compared, rows_at, warmed, without

TIME = np.arange(0.0, 3600.0, 10.0)
PHASE = TIME / TIME[-1]
WARM = 1.0 - np.exp(-TIME / 600.0)
TRUE = {SLIP: {"b": 0.03, "T0": USUAL}}


def test_a_course_in_words() -> None:
    """What rises, falls, turns or does nothing is told so, in either direction, whatever its size
    and offset, in shares of its span, and in fitting units of time."""
    way = "slow, {} from the start, two thirds of the way within 10 min"
    wave = np.sin(np.pi * PHASE) ** 2
    for course, expected in (
        (np.full(len(TIME), 3.0), "constant"),
        (WARM, way.format("rises")),
        (-1e6 * WARM, way.format("falls")),
        (7.0 + 1e-9 * wave, "slow, turns 1 time over 60 min"),
        (-wave, "slow, turns 1 time over 60 min"),
        (np.sin(2 * np.pi * PHASE) ** 4, "slow, turns 3 times over 60 min"),
    ):
        assert expected == described(TIME, course)
    assert "turns" not in described(TIME, PHASE + 0.02 * np.sin(200 * PHASE))
    up_first = np.sin(4 * np.pi * PHASE)
    assert "falls from the start" not in described(TIME, up_first)
    for seconds, span in ((60.0, "60 s"), (36000.0, "10.0 h")):
        assert f"over {span}" in described(seconds * PHASE, up_first)
    stops = np.concatenate([TIME, TIME + 9000.0])  # warms up, stands for an hour, is cold again
    assert described(stops, np.concatenate([WARM, WARM])).endswith("returns during stops")


def test_what_drives_a_slip_shows_in_its_parameter() -> None:
    """The pressure moves; an error that adds to the flow would have to move with it."""
    run = warmed(TRUE)
    found = search(rows_at(alone(), without(run, "A.T")), lambda text: None)
    (wandering,) = found.fitted.setting.joined
    assert wandering.id.startswith("parameter:A.C")
    assert wandering.place == "Q_geo"
    hidden = reconstruct(found.fitted, wandering.id)
    warm = np.interp(hidden.time, run.time, run.values["A.T"])
    assert abs(np.corrcoef(hidden.course, warm)[0, 1]) > 0.9


@pytest.mark.prove
def test_one_driver_behind_two_laws_is_told_at_both() -> None:
    """A temperature nobody recorded moves friction and slip: two courses that are alike."""
    built = {**TRUE, "A.friction-temperature@P_law": {"b": 0.02, "T0": USUAL}}
    found = compared(alone(), without(warmed(built), "A.T"))
    assert found.verdict == "unnamed"
    assert not found.findings
    assert [where.place for where in found.locations] == ["P_law", "Q_geo"]
    assert sum(where.share for where in found.locations) == pytest.approx(1.0)
    assert found.hidden is not None
    said = "in A.Q_geo changes too, and its course correlates with this one by −0.9"
    assert said in found.hidden.text
