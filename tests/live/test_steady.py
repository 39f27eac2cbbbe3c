"""Clocks that jump, forward or back, both at once: nothing waits for the time that was skipped."""

import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import steady_clock as module
from rulec_runtime.live.sources.remarks import Silence
from rulec_runtime.live.steady_clock import Standstill, Steady

from tests.live.sources.plant_server import PlantServer
from tests.live.sources.test_mqtt import without_broker
from tests.live.sources.test_opcua import Watch, _short  # noqa: F401

HOUR = 3600.0


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """By how many s clocks of this process are `ahead`, and that of the wall as well."""
    made, before = SimpleNamespace(ahead=0.0, wall=0.0), dict(vars(module.steady))
    set_by_hand = SimpleNamespace(
        monotonic=lambda: time.monotonic() + made.ahead,
        time=lambda: time.time() + made.ahead + made.wall,
    )
    monkeypatch.setattr(module, "time", set_by_hand)
    yield made
    made.ahead = made.wall = 0.0
    vars(module.steady).update(before)


def test_a_clock_that_is_set_back_runs_on(clocks: SimpleNamespace) -> None:
    clock, begun = Steady(), time.time()
    since = clock()
    for ahead in (HOUR, -HOUR):
        clocks.ahead = ahead
        assert clock() - since == pytest.approx(HOUR, abs=0.1)
    assert clock.wall() - begun == pytest.approx(HOUR, abs=0.1)
    clocks.wall = 4 * HOUR
    assert clock.wall() - begun == pytest.approx(3 * HOUR, abs=0.1)
    assert clock() - since == pytest.approx(HOUR, abs=0.1)


def test_a_standstill_is_no_silence(clocks: SimpleNamespace) -> None:
    silence, still = Silence(10.0), Standstill()
    clocks.ahead = HOUR
    assert not silence.begins()
    assert still.lasted == pytest.approx(HOUR, abs=0.1)
    still.moves()
    clocks.wall = HOUR  # a machine that was suspended
    assert still.lasted == pytest.approx(HOUR, abs=0.1)
    still.moves()
    assert still.lasted == 0.0
    for _ in range(3):
        clocks.ahead += 4.0
        stale = silence.begins()
    assert stale


def test_all_clocks_jump(clocks: SimpleNamespace, abc: Ruleset, tmp_path: Path) -> None:
    """Ahead, back and ahead again: a gap is told, no alarm; times of rows increase."""
    server = PlantServer()
    _, heard = without_broker(abc, tmp_path, "signals: {A.dp: t/dp}")
    taken = Watch(abc, tmp_path).of(server.url).until(lambda t: len(t.times) >= 3)
    heard.take()
    for jump in (HOUR, 0.0, 2 * HOUR):
        clocks.ahead = jump
        if jump == HOUR:
            heard.until(lambda t: "this computer stood still for 3600 s" in str(t.told))
        count = len(taken.times)
        taken.take(0.5).until(lambda t, n=count: len(t.times) > n + 3)
    for one in (taken, heard):
        one.source.close()
    server.stop()
    assert (np.diff(taken.times) > 0).all()
    gaps = [text for kind, text in taken.told if kind == "gap"]
    assert len(gaps) == 2
    assert all("stood still, or its clock was set" in text for text in gaps)
    assert not {"lost", "stale"} & set(taken.kinds())
