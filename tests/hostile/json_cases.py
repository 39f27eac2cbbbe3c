"""Hostile rulesets, and hostile results of a mismatch."""

import json
import random
from collections.abc import Iterator
from typing import Any

from tests.conftest import ROOT, compiled
from tests.hostile.case import Case, sealed
from tests.hostile.recording_cases import SHEET

ODD: list[Any] = [None, True, -1, 0, 1e308, 10**40, "", "\x1b[31m", [], {}, [[]], "A.n", -1.5]
RECORDING = SHEET.text()


def diagnosed(family: str, name: str, text: str | bytes) -> Case:
    files = {"x.json": text, "r.csv": RECORDING}
    return Case(family, name, ("diagnose", "x.json", "r.csv", "--trace", "t.csv"), files)


def parts(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every group or list with each of its keys."""
    keys = data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    for key in [*keys]:
        yield data, key
        yield from parts(data[key])


def cases() -> Iterator[Case]:
    text = compiled("abc").to_json()
    data, raw = json.loads(text), text.encode()
    yield from _corrupted(raw)
    yield from _resealed(text)
    for name, spoilt in _texts(data):
        yield diagnosed("shapes of JSON", name, spoilt)
    for i, change in enumerate(_changes(data["signals"])):
        yield diagnosed("shapes of JSON", f"changed {i}", sealed({**data, **change}))
    for i, change in enumerate(REPAIRS):
        yield adopted(f"{i}", json.dumps({"recording": "r.csv", "repair": {**GOOD, **change}}))
    newline = {"recording": "r.csv\nkb: /tmp\n\x1b[31m", "repair": GOOD}
    yield adopted("line in the recording", json.dumps(newline))
    for i, spoilt in enumerate(NO_RESULTS):
        yield adopted(f"no result {i}", spoilt)


def _corrupted(raw: bytes) -> Iterator[Case]:
    rng = random.Random(1)
    for i in range(15):
        spoilt = bytearray(raw)
        for _ in range(rng.randint(1, 3)):
            at = rng.randrange(len(spoilt))
            spoilt[at] = rng.choice(b'0123456789eE.-,:[]{}" ab\\\x1b\xff')
        yield diagnosed("corrupted rulesets", f"bytes {i}", bytes(spoilt))
    for share in (0.1, 0.999):
        yield diagnosed("corrupted rulesets", f"cut at {share}", raw[: int(share * len(raw))])


def _resealed(text: str) -> Iterator[Case]:
    """One value changed by somebody who knows how the digest is made."""
    rng, data = random.Random(2), json.loads(text)
    keys = sorted(key for key in data if isinstance(data[key], dict | list) and data[key])
    for i in range(25):
        changed, key = json.loads(text), keys[i % len(keys)]
        group, part = rng.choice(list(parts(changed[key])))
        group[part] = rng.choice(ODD)
        yield diagnosed("resealed rulesets", f"{key} {i}", sealed(changed))


def _texts(data: Any) -> Iterator[tuple[str, str]]:
    for number in ("1" + "0" * 400, "1e999", "NaN"):
        yield number[:5], json.dumps(data).replace("1.0", number, 1)
    yield "10**5000", '{"format_version": 1' + "0" * 5000 + "}"
    yield "deep list", "[" * 100_000
    yield "deep group", '{"a":' * 100_000
    yield "deep version", '{"format_version": ' + "[" * 5000 + "]" * 5000 + "}"
    yield "without a digest", json.dumps({k: v for k, v in data.items() if k != "digest"})
    for version in ('"\\u001b[31m"', '"\\ud800"', "3"):
        yield f"version {version}", '{"format_version": ' + version + "}"
    for text in ("null", '"x"', "{}", "\0"):
        yield text, text


def _changes(signals: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    yield {"signals": [{**signals[0], "id": ["x"]}, *signals[1:]]}
    yield {"signals": [*signals, signals[0]]}
    for odd in ({"factor": 0.0}, {"standard": -1.0}, {"reference": 1e308}):
        yield {"signals": [{**s, **odd} for s in signals]}
    for title in ("\x1b[2J", "[/x]"):
        yield {"title": title}
    for name in ("signals", "faults", "residuals", "observers"):
        yield {name: []}
    yield {"units": {}}
    yield {"plant": ["p"]}
    yield {"plan": {"inputs": [], "constants": [], "operations": [], "outputs": {}}}


PLANT = str(ROOT / "plants" / "abc")
GOOD = {
    "plant": PLANT,
    "joined": [],
    "parameters": ["A.C0"],
    "values": [1e-6],
    "covariance": [[1e-16]],
    "misfit": {},
    "range": {},
}
REPAIRS: list[dict[str, Any]] = [
    *({"parameters": p} for p in (3, "A.C0", ["\x1b[31m"], ["A.bogus"], ["Z.k2"])),
    *({"values": v} for v in ([], ["x"], [1e309], [10**400])),
    *({"covariance": c} for c in ([1, 2, 3], [[1], [1, 2]], [[-1.0]], {"a": 1})),
    *({"joined": j} for j in (5, [{}], ["x"], [{"id": "[/x]", "unknowns": {}}])),
    *({"misfit": m} for m in ([1], {"A.pump": "x"})),
    *({"range": {"A.n": r}} for r in ([1], ["a", "b"])),
    *({"plant": p} for p in ([PLANT], "../../../etc", "\x1b[31m", "a\0b", "x" * 5000)),
]
NO_RESULTS = ["[" * 100_000, "", "{}", "null", '{"repair": []}', '{"repair": {"values": [NaN]}}',
              "\0\x01"]  # fmt: skip


def adopted(name: str, text: str) -> Case:
    return Case("repairs", name, ("adopt", "m.json", "-o", "new"), {"m.json": text})
