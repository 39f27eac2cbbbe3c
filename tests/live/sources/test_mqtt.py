"""MQTT against a broker on loopback that is stopped and started again."""

import json
import math
import random
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import MQTT, read_map
from rulec_runtime.live.sources.mqtt import Mqtt
from rulec_runtime.live.sources.open import open_source

from tests.live.journal.own_broker import OwnBroker
from tests.live.journal.test_mqtt_out import listening
from tests.live.sources.plant_server import free_port
from tests.live.sources.taking import Taken, check, mutated

MAP = """
interval: 0.2
stale: 0.6
signals:
  A.dp: {topic: plant/A, name: dp, unit: mbar}
  A.n: {topic: plant/A, name: n, unit: rpm}
"""


def without_broker(abc: Ruleset, tmp_path: Path, text: str) -> tuple[Mqtt, Taken]:
    """A source that hears what tests tell it, and what is taken of it."""
    path = tmp_path / "map.yaml"
    path.write_text(f"endpoint: mqtt://127.0.0.1:{free_port()}\n{text}", encoding="utf-8")
    source = Mqtt(read_map(path, MQTT, abc), abc)
    return source, Taken(source)


def test_rows_of_a_broker_that_goes_and_comes_back(abc: Ruleset, tmp_path: Path) -> None:
    """A message with all signals is a row; lost, stale, connected and the gap are told; that values
    come again as well. Nothing is published but what the plant itself sends."""
    path = tmp_path / "map.yaml"
    path.write_text(MAP, encoding="utf-8")
    broker = OwnBroker()
    source = open_source(f"mqtt://127.0.0.1:{broker.port}", abc, path)
    taken = Taken(source).until(lambda t: "connected" in t.kinds())
    client, heard = listening(broker.port, "#")
    stamp = time.time() - 5

    def send(at: float, dp: float) -> None:
        payload = json.dumps({"time": stamp + at, "dp": dp, "n": 900})
        client.publish("plant/A", payload, qos=1).wait_for_publish(5)

    for i in range(5):
        send(0.1 * i, 1800.0 + i)
    taken.until(lambda t: len(t.times) == 5 and heard.qsize() == 5)
    np.testing.assert_allclose(taken.times, stamp + 0.1 * np.arange(5))
    np.testing.assert_allclose(taken.of("A.dp"), 1.8e5 + 100 * np.arange(5))
    client.loop_stop()
    broker.stop()
    taken.until(lambda t: {"lost", "stale"} <= set(t.kinds()))
    broker.start()
    taken.until(lambda t: "gap" in t.kinds(), 15.0)
    client, more = listening(broker.port, "#")
    send(2.0, 1900.0)
    taken.until(lambda t: len(t.times) == 6 and more.qsize())
    taken.source.close()
    client.loop_stop()
    broker.stop()
    assert [topic for topic, _ in (*heard.queue, *more.queue)] == ["plant/A"] * 6
    kinds = taken.kinds()
    assert [kinds.count(k) for k in ("connected", "lost", "gap")] == [3, 1, 1]
    assert [n.still for n in taken.notices if n.kind == "connected"] == [False, True, False]


METRICS = [
    {"name": "other", "value": 1},
    {"name": "a/x", "value": 1.5, "timestamp": 1_790_000_001_000},
]


@pytest.mark.parametrize(
    ("address", "payload", "bar", "stamp"),
    [
        ("t", 1.5, 1.5, None),
        ("t", {"value": 1.5, "timestamp": 1_790_000_000_000, "quality": "GOOD"}, 1.5, 1.79e9),
        ("t", {"value": 1.5, "timestamp": "2026-09-21T14:13:20Z", "quality": 192}, 1.5, 1.79e9),
        ("t", {"value": 1.5, "ts": 1.79e9, "quality": 0}, math.nan, 1.79e9),
        ("t", {"value": "1.5", "ts": 1.79e9}, math.nan, 1.79e9),
        ("{topic: t, name: x}", {"x": 1.5, "t": 1.79e18}, 1.5, 1.79e9),
        ("{topic: t, name: x}", {"x": {"value": 1.5, "t": 1.79e9}}, 1.5, 1.79e9),
        ("{topic: t, name: a/x}", {"timestamp": 1, "metrics": METRICS}, 1.5, 1.79e9 + 1),
    ],
)
def test_forms_of_messages(
    address: str, payload: Any, bar: float, stamp: float | None, abc: Ruleset, tmp_path: Path
) -> None:
    """One signal per topic, objects, and messages like those of Sparkplug."""
    text = "signals: {A.dp: {topic: t, unit: bar}}\n"
    if address != "t":
        text = f"signals:\n  A.dp: {address[:-1]}, unit: bar}}\n"
    source, taken = without_broker(abc, tmp_path, text)
    source.receive("t", json.dumps(payload).encode())
    taken.until(lambda t: t.rows)
    source.close()
    np.testing.assert_allclose(taken.of("A.dp"), [bar * 1e5])
    expected = time.time() if stamp is None else stamp
    assert taken.times[0] == pytest.approx(expected, abs=5 if stamp is None else 1e-3)


def test_key_of_stamps_and_name_of_the_watch(abc: Ruleset, tmp_path: Path) -> None:
    """Then no other key is a stamp, and the broker keeps what comes while the watch is away."""
    text = "time: measured\nclient: hall-1\nsignals: {A.dp: {topic: t, unit: bar}}\n"
    source, taken = without_broker(abc, tmp_path, text)
    source.receive("t", json.dumps({"value": 1.5, "measured": 1.79e9, "time": 1.0}).encode())
    taken.until(lambda t: t.rows)
    source.close()
    assert taken.times[0] == pytest.approx(1.79e9, abs=1e-3)
    client = source._client
    assert (client._client_id, client._clean_session) == (b"hall-1", False)


def test_signals_of_several_topics_become_rows(abc: Ruleset, tmp_path: Path) -> None:
    """Twice and late are left out and told once; what falls silent has no reading, and alone."""
    text = "interval: 0.2\nstale: 0.5\nsignals: {A.dp: t/dp, A.n: t/n}\n"
    source, taken = without_broker(abc, tmp_path, text)
    start = time.time() - 100

    def send(topic: str, value: float, at: float) -> None:
        source.receive(topic, json.dumps({"value": value, "time": start + at}).encode())

    for i in range(4):
        send("t/dp", 1.8, i)
        send("t/dp", 1.8, i)
        send("t/n", 900, i + 0.01)
        send("t/n", 900, i - 0.5)
    taken.take()
    np.testing.assert_allclose(np.array(taken.times) - start, np.arange(4) + 0.01, atol=1e-6)
    assert taken.kinds().count("clock") == 2
    for i in range(4, 30):
        send("t/n", 900, i)
        time.sleep(0.03)
    taken.until(lambda t: math.isnan(t.of("A.dp")[-1]))
    # The others still come: it is that signal, not the plant, that is not read.
    assert [n.signal for n in taken.notices if n.kind == "stale"] == ["A.dp"]
    send("t/dp", 1.8, 30)
    taken.until(lambda t: t.reports[-1] == ("connected", "all values come again"))
    source.close()
    assert (np.diff(taken.times) > 0).all()


def test_stamps_of_the_future_do_not_blind_the_watch(abc: Ruleset, tmp_path: Path) -> None:
    """A clock an hour ahead, then right again: no value is late."""
    source, taken = without_broker(abc, tmp_path, "signals: {A.dp: t}\n")
    begin = time.time()
    for ahead in (3600.0, 3600.0, 0.0):
        source.receive("t", json.dumps({"value": 1.8, "time": time.time() + ahead}).encode())
        time.sleep(0.01)
    taken.until(lambda t: len(t.times) == 3)
    source.close()
    assert begin <= taken.times[0] < taken.times[-1] <= time.time()
    assert taken.kinds().count("clock") == 1


MESSAGES = [
    json.dumps(m).encode()
    for m in (
        {"time": 1.79e9, "dp": 1.8, "n": 900},
        {"timestamp": 1_790_000_000_000, "metrics": [{"name": "dp", "value": 1, "timestamp": 2}]},
        {"dp": {"value": 1.8, "timestamp": "2026-09-21T14:13:20Z", "quality": "GOOD"}},
        1.5,
    )
]


def test_mutated_messages(abc: Ruleset, tmp_path: Path) -> None:
    """By the thousand: nothing escapes, nothing steers."""
    source, _ = without_broker(abc, tmp_path, f"{MAP}  B.dp: plant/B\n")
    draw, count = random.Random(7), 0
    for _ in range(2000):
        source.receive(draw.choice(("plant/A", "plant/B")), mutated(draw.choice(MESSAGES), draw))
        count += check(source.take(0.0))[1]
    source.receive("plant/A", b"1" * (limits.LARGEST_MESSAGE + 1))
    parts = source.take(0.0)
    assert any("more than" in p.text for p in parts if isinstance(p, Notice))
    now = time.time()
    good = {"time": now + 1, "dp": 1800, "n": 900}
    source.receive("plant/A", json.dumps(good).encode())
    source.receive("plant/B", b"1.8")
    rows, _ = check(source.take(1.0))
    source.close()
    assert rows >= 1, "it still reads after all of that"
    assert count < 200, "what keeps coming is told once"
