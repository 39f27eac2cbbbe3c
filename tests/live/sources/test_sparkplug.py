"""Sparkplug B: births, aliases, quality, sequence; payloads as other programs write them."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources import limits, remarks
from rulec_runtime.live.sources.mqtt import Mqtt
from rulec_runtime.live.sources.mqtt_payload import BadPayload, message_of
from rulec_runtime.live.sources.remarks import SourceRefused

from tests.live.sources.taking import Taken, check, mutated
from tests.live.sources.test_mqtt import without_broker

# Written by pysparkplug 0.6.1, the quality by its protobuf classes.
BIRTH_OF_NODE = bytes.fromhex(
    "0880d8c1a28c3412120a0562645365711880d8c1a28c342004580312210a144e6f646520436f6e74726f6c2f52656269"
    "7274681880d8c1a28c34200b70001800"
)
BIRTH = bytes.fromhex(
    "0880d8c1a28c3412180a02647010071880d8c1a28c34200a69000000000000fc3f12110a016e10081880d8c1a28c3420"
    "0350840712130a015410091880d8c1a28c342009650000a4411801"
)
DATA = bytes.fromhex(
    "08e8dfc1a28c341214100718e8dfc1a28c34200a69cdccccccccccfc3f121110081884dfc1a28c34200350fbffffff0f"
    "120d100918e8dfc1a28c34200938011802"
)
HISTORICAL = bytes.fromhex("08d0e7c1a28c3412180a02647018f4dbc1a28c34200a280169666666666666fe3f1803")
QUALITY = bytes.fromhex(
    "08b8efc1a28c34123a0a02647018b8efc1a28c34200a4a220a07656e67556e69740a075175616c6974791207080c4203"
    "6261721205080318f403699a9999999999fd3f12210a016e18b8efc1a28c3420034a100a075175616c69747912050803"
    "18c0015085071804"
)
NO_MESSAGES = [b"\x08", b"\x12\x7f", b"\x00\x01", b"\x0b", b"\x08" + b"\xff" * 11]
NO_MESSAGES.append(b"\x12\x03\x0a\x01\xff")

NODE, DEVICE = "spBv1.0/site/{}/edge", "spBv1.0/site/{}/edge/A"
MAP = """
interval: 0.2
signals:
  A.dp: {topic: spBv1.0/site/DDATA/edge/A, name: dp, unit: bar}
  A.n: {topic: spBv1.0/site/DBIRTH/edge/A, name: n, unit: rpm}
  A.T: {topic: spBv1.0/site/DDATA/edge/A, name: T, unit: degC}
"""


@dataclass
class Plant:
    """What the source hears, and what came of it."""

    source: Mqtt
    taken: Taken

    def says(self, topic: str, kind: str, payload: bytes = b"") -> Plant:
        self.source.receive(topic.format(kind), payload)
        self.taken.take()
        return self

    def born(self) -> Plant:
        return self.says(NODE, "NBIRTH", BIRTH_OF_NODE).says(DEVICE, "DBIRTH", BIRTH)

    def last(self) -> tuple[float, float]:
        """Readings of the last row: bar, and revolutions a minute."""
        dp, n = self.taken.of("A.dp")[-1], self.taken.of("A.n")[-1]
        return round(dp / 1e5, 6), round(n * 60 / self.turn, 6)

    turn = 1.0

    def reports(self) -> list[str]:
        return [text for kind, text in self.taken.reports if kind in ("gap", "refused", "clock")]


@pytest.fixture
def plant(abc: Ruleset, tmp_path: Path) -> Iterator[Plant]:
    found = Plant(*without_broker(abc, tmp_path, MAP))
    found.turn = abc.signal_by_id["A.n"].factor * 60
    yield found
    found.source.close()


def varint(number: int) -> bytes:
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])


def data(sequence: int, *, alias: int = 7, at: int = 1_790_000_010_000) -> bytes:
    """1.8 bar by an alias."""
    metric = DATA[9:29].replace(b"\x10\x07", b"\x10" + varint(alias), 1)
    metric = metric.replace(varint(1_790_000_001_000), varint(at))
    return (
        b"\x08" + varint(at) + b"\x12" + varint(len(metric)) + metric + b"\x18" + varint(sequence)
    )


def test_names_are_those_of_the_birth(plant: Plant) -> None:
    """What a node kept while it was cut off is no reading of now; quality 500 is stale; JSON under
    such a topic is read as before."""
    assert plant.born().last() == (1.75, 900.0)
    assert plant.taken.of("A.T") == [20.5 + 273.15]
    plant.says(DEVICE, "DDATA", DATA)
    assert plant.last() == (1.8, -5.0)
    assert math.isnan(plant.taken.of("A.T")[-1])
    later = message_of(DATA)
    assert [later.stamp, *(m.stamp for m in later.metrics)] == [1.79e9 + t for t in (1, 1, 0.9, 1)]
    assert [m.null for m in later.metrics] == [False, False, True]
    np.testing.assert_allclose(plant.taken.times, [1.79e9, 1.79e9 + 1])
    assert plant.reports() == ["A.T has no reading: no number"]
    plant.says(DEVICE, "DDATA", HISTORICAL)
    assert plant.last() == (1.8, -5.0)
    plant.says(DEVICE, "DDATA", QUALITY)
    dp, n = plant.last()
    assert math.isnan(dp)
    assert n == 901.0
    assert plant.reports()[1:] == [
        "site/edge/A: values that it kept while it was cut off are left out",
        "A.dp has no reading: bad quality",
    ]
    text = b'{"timestamp": 1790000009000, "metrics": [{"name": "dp", "value": 1.7}]}'
    plant.says(DEVICE, "DDATA", text).taken.until(lambda _: plant.last()[0] == 1.7)


def test_without_a_birth_aliases_say_nothing(plant: Plant) -> None:
    """Names do; a birth of the node takes back what its devices said, and an alias that is given
    anew is not mistaken."""
    plant.says(DEVICE, "DDATA", data(6)).says(DEVICE, "DDATA", data(7))
    assert plant.taken.times == []
    assert plant.reports() == ["site/edge/A: values come by alias; they are read from its birth on"]
    plant.says(DEVICE, "DDATA", QUALITY[:-1] + b"\x08")
    assert plant.last()[1] == 901.0
    plant.says(NODE, "NBIRTH", BIRTH_OF_NODE).says(DEVICE, "DDATA", data(1))
    assert len(plant.taken.times) == 1
    other = BIRTH.replace(b"\x0a\x02dp\x10\x07", b"\x0a\x02xx\x10\x07").replace(
        varint(1_790_000_000_000), varint(1_790_000_004_000)
    )
    plant.born().says(DEVICE, "DBIRTH", other[:-1] + b"\x02")
    plant.says(DEVICE, "DDATA", data(3))
    dp, n = plant.last()
    assert math.isnan(dp)
    assert n == 900.0


def test_messages_that_are_missing_are_told(plant: Plant) -> None:
    """Once; the sequence begins at 0 again behind 255, and with a birth of the node."""
    plant.born()
    for i, sequence in enumerate([2, 3, 6, 9]):
        plant.says(DEVICE, "DDATA", data(sequence, at=1_790_000_010_000 + 1000 * i))
    assert plant.reports() == ["site/edge: message 6 follows 3; what is between is missing"]
    plant.says(NODE, "NBIRTH", BIRTH_OF_NODE)
    assert len(plant.reports()) == 1
    assert len(plant.taken.times) == 5


def test_a_device_that_is_gone_has_no_readings(plant: Plant) -> None:
    plant.born().says(DEVICE, "DDEATH", b"\x18\x02")
    assert plant.reports() == ["site/edge/A says that it is gone (DDEATH)"]
    plant.says(DEVICE, "DDATA", QUALITY[:-1] + b"\x03")
    dp, n = plant.last()
    assert math.isnan(dp)
    assert n == 901.0
    plant.says(NODE, "NDEATH")
    assert plant.reports()[-1] == "site/edge says that it is gone (NDEATH)"


def test_values_hold(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sparkplug sends what has changed alone."""
    clock = [1e6]
    monkeypatch.setattr(remarks, "clocks", SimpleNamespace(monotonic=lambda: clock[0]))
    plant.born()
    for i in range(4):
        clock[0] += 0.4 * limits.STALE
        plant.says(NODE, "NDATA", b"\x18" + varint(2 + i))
        plant.source._rows.tick()
    assert "stale" not in plant.taken.take().kinds()
    for _ in range(3):
        clock[0] += 0.4 * limits.STALE
        plant.source._rows.tick()
    assert "stale" in plant.taken.take().kinds()


@pytest.mark.parametrize(
    ("signal", "words"),
    [("spBv1.0/site/DDATA/edge/A", "needs 'name:'")]
    + [
        (f"{{topic: {topic}, name: dp}}", "is spBv1.0/GROUP/NDATA/NODE")
        for topic in ("spBv1.0/site/NDATA/edge/A", "spBv1.0/site/DCMD/edge/A", "spBv1.0/site")
    ],
)
def test_mistakes_in_a_map(signal: str, words: str, abc: Ruleset, tmp_path: Path) -> None:
    with pytest.raises(SourceRefused, match=words):
        without_broker(abc, tmp_path, f"signals:\n  A.dp: {signal}\n")


def test_mutated_payloads(plant: Plant) -> None:
    """No traceback, nothing that steers a terminal, few notices; and it still reads."""
    for payload in NO_MESSAGES:
        with pytest.raises(BadPayload, match="neither Sparkplug B nor JSON"):
            message_of(payload)
    draw, count = random.Random(11), 0
    sound = [BIRTH_OF_NODE, BIRTH, DATA, HISTORICAL, QUALITY]
    for _ in range(2000):
        topic = draw.choice((NODE, DEVICE))
        kind = draw.choice(("BIRTH", "DATA", "DATA", "DEATH", "CMD"))
        payload = mutated(draw.choice(sound), draw)
        plant.source.receive(topic.format(("D" if topic is DEVICE else "N") + kind), payload)
        count += check(plant.source.take(0.0))[1]
    assert count < 200
    at = varint(int(time.time() * 1000))
    plant.says(NODE, "NBIRTH", BIRTH_OF_NODE)
    plant.says(DEVICE, "DBIRTH", BIRTH.replace(varint(1_790_000_000_000), at))
    assert plant.last() == (1.75, 900.0)
