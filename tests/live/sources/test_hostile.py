"""Messages that were mutated, by the thousand: nothing escapes, nothing steers."""

from __future__ import annotations

import json
import random
import time
from pathlib import Path

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.output.terminal import is_shown

from tests.live.sources.test_mqtt import without_broker

PIECES = [
    *(b"\x1b[2J", b"\x1b]0;x\x07", b"\0", b"\xff\xfe", b"\xe2\x80\xae", b"\xed\xa0\x80"),
    *(b"\r", b"\n", b'"', b"'", b"{", b"}", b"]", b"[" * 2000, b",", b";", b"#", b"sep=,"),
    *(b"NaN", b"Infinity", b"1e999", b"-1e308", b"9" * 5000, b"0x10", b"1_0", b"null", b"true"),
    *(b'{"value":', b'"metrics":[', b"[/red]", b"$(id)", b"\\u0000", b"\\u001b[2J", b"=1+1"),
]
MESSAGES = [
    json.dumps(m).encode()
    for m in (
        {"time": 1.79e9, "dp": 1.8, "n": 900},
        {"timestamp": 1_790_000_000_000, "metrics": [{"name": "dp", "value": 1, "timestamp": 2}]},
        {"dp": {"value": 1.8, "timestamp": "2026-09-21T14:13:20Z", "quality": "GOOD"}},
        1.5,
    )
]
MAP = """
signals:
  A.dp: {topic: plant/A, name: dp, unit: mbar}
  A.n: {topic: plant/A, name: n, unit: rpm}
  B.dp: plant/B
"""


def mutated(text: bytes, draw: random.Random) -> bytes:
    """Bytes changed, cut, doubled, and pieces of other things put in."""
    data = bytearray(text)
    for _ in range(draw.randrange(1, 5)):
        at = draw.randrange(len(data) + 1)
        match draw.randrange(5):
            case 0:
                data[at:at] = draw.choice(PIECES)
            case 1:
                del data[at : at + draw.randrange(1, 20)]
            case 2 if at < len(data):
                data[at] = draw.randrange(256)
            case 3:
                data[at:at] = data[: draw.randrange(40)]
            case _:
                data[at : at + draw.randrange(8)] = draw.choice(PIECES)
    return bytes(data)


def check(parts: list[Rows | Notice]) -> tuple[int, int]:
    """How many rows and notices; nothing in a notice steers a terminal, rows are numbers."""
    rows = [p for p in parts if isinstance(p, Rows)]
    notices = [p for p in parts if isinstance(p, Notice)]
    for one in notices:
        assert all(is_shown(c) for c in one.text), one
        assert len(one.text) <= limits.LONGEST_NOTICE + 3
    for block in rows:
        assert np.isfinite(block.time).all()
        assert (np.diff(block.time) > 0).all()
        assert not any(np.isinf(v).any() for v in block.values.values())
    return sum(map(len, rows)), len(notices)


def test_mutated_messages(abc: Ruleset, tmp_path: Path) -> None:
    source, _ = without_broker(abc, tmp_path, MAP)
    draw, told = random.Random(7), 0
    for _ in range(2000):
        source.receive(draw.choice(("plant/A", "plant/B")), mutated(draw.choice(MESSAGES), draw))
        told += check(source.take(0.0))[1]
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
    assert told < 200, "what keeps coming is told once"
