"""Hostile rulesets, and hostile results of a mismatch."""

from __future__ import annotations

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
    keys = (
        list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    )
    for key in keys:
        yield data, key
        yield from parts(data[key])


def cases() -> Iterator[Case]:
    text = compiled("abc").to_json()
    data = json.loads(text)
    yield from _corrupted(text)
    yield from _resealed(text)
    yield from _shapes(data)
    yield from _repairs()


def _corrupted(text: str) -> Iterator[Case]:
    rng = random.Random(1)
    raw = text.encode()
    for i in range(40):
        spoilt = bytearray(raw)
        for _ in range(rng.randint(1, 3)):
            at = rng.randrange(len(spoilt))
            spoilt[at] = rng.choice(b'0123456789eE.-,:[]{}" ab\\\x1b\xff')
        yield diagnosed("corrupted rulesets", f"bytes {i}", bytes(spoilt))
    for share in (0.1, 0.5, 0.9, 0.999):
        yield diagnosed("corrupted rulesets", f"cut at {share}", raw[: int(share * len(raw))])


def _resealed(text: str) -> Iterator[Case]:
    """One value changed by somebody who knows how the digest is made."""
    rng = random.Random(2)
    data = json.loads(text)
    places = {key: list(parts(data[key])) for key in data if isinstance(data[key], dict | list)}
    for i in range(40):
        changed = json.loads(text)
        key = rng.choice(sorted(places))
        found = list(parts(changed[key]))
        if found:
            group, part = rng.choice(found)
            group[part] = rng.choice(ODD)
        yield diagnosed("resealed rulesets", f"{key} {i}", sealed(changed))


def _shapes(data: Any) -> Iterator[Case]:
    family = "shapes of JSON"
    signals = data["signals"]
    for name, text in {
        "10**400": json.dumps(data).replace("1.0", "1" + "0" * 400, 1),
        "10**5000": '{"format_version": 1' + "0" * 5000 + "}",
        "1e999": json.dumps(data).replace("1.0", "1e999", 1),
        "NaN": json.dumps(data).replace("1.0", "NaN", 1),
        "deep list": "[" * 100_000,
        "deep group": '{"a":' * 100_000,
        "deep version": '{"format_version": ' + "[" * 5000 + "]" * 5000 + "}",
        "null": "null",
        "text": '"x"',
        "escape in the version": '{"format_version": "\\u001b[31m"}',
        "a lone surrogate": '{"format_version": "\\ud800"}',
        "no version": "{}",
        "nothing else": '{"format_version": 3}',
        "null byte": "\0",
        "without a digest": json.dumps({k: v for k, v in data.items() if k != "digest"}),
    }.items():
        yield diagnosed(family, name, text)
    for name, changed in {
        "a list as name": {"signals": [{**signals[0], "id": ["x"]}, *signals[1:]]},
        "a list as plant": {"plant": ["p"]},
        "steering title": {"title": "\x1b[2J"},
        "markup as title": {"title": "[/x]"},
        "no signals": {"signals": []},
        "no units": {"units": {}},
        "a signal twice": {"signals": [*signals, signals[0]]},
        "factor 0": {"signals": [{**s, "factor": 0.0} for s in signals]},
        "standard below 0": {"signals": [{**s, "standard": -1.0} for s in signals]},
        "reference huge": {"signals": [{**s, "reference": 1e308} for s in signals]},
        "no plan": {"plan": {"inputs": [], "constants": [], "operations": [], "outputs": {}}},
        "no faults": {"faults": []},
        "no residuals": {"residuals": []},
        "no observers": {"observers": []},
    }.items():
        yield diagnosed(family, name, sealed({**data, **changed}))


def _repairs() -> Iterator[Case]:
    plant = str(ROOT / "plants" / "abc")
    good = {
        "plant": plant,
        "joined": [],
        "parameters": ["A.C0"],
        "values": [1e-6],
        "covariance": [[1e-16]],
        "misfit": {},
        "range": {},
    }
    changes: dict[str, Any] = {
        "parameters no list": {"parameters": 3},
        "parameters a text": {"parameters": "A.C0"},
        "values too few": {"values": []},
        "values texts": {"values": ["x"]},
        "values infinite": {"values": [1e308 * 10]},
        "value of 400 digits": {"values": [10**400]},
        "covariance flat": {"covariance": [1, 2, 3]},
        "covariance ragged": {"covariance": [[1], [1, 2]]},
        "covariance negative": {"covariance": [[-1.0]]},
        "covariance a group": {"covariance": {"a": 1}},
        "joined no list": {"joined": 5},
        "joined without id": {"joined": [{}]},
        "joined texts": {"joined": ["x"]},
        "misfit a list": {"misfit": [1]},
        "misfit a text": {"misfit": {"A.pump": "x"}},
        "range of one": {"range": {"A.n": [1]}},
        "range of texts": {"range": {"A.n": ["a", "b"]}},
        "plant a list": {"plant": [plant]},
        "plant elsewhere": {"plant": "../../../etc"},
        "plant steering": {"plant": "\x1b[31m"},
        "plant with a null": {"plant": "a\0b"},
        "plant too long": {"plant": "x" * 5000},
        "parameter steering": {"parameters": ["\x1b[31m"]},
        "parameter unknown": {"parameters": ["A.bogus"]},
        "parameter of no module": {"parameters": ["Z.k2"]},
        "candidate unknown": {"joined": [{"id": "[/x]", "unknowns": {}}]},
    }
    for name, change in changes.items():
        data = {"recording": "r.csv", "repair": {**good, **change}}
        yield adopted(name, json.dumps(data))
    newline = {"recording": "r.csv\nkb: /tmp\n\x1b[31m", "repair": good}
    yield adopted("line in the recording", json.dumps(newline))
    for name, text in {
        "deep": "[" * 100_000,
        "nothing": "",
        "no repair": "{}",
        "null": "null",
        "repair a list": '{"repair": []}',
        "NaN": '{"repair": {"values": [NaN]}}',
        "binary": "\0\x01",
    }.items():
        yield adopted(name, text)


def adopted(name: str, text: str) -> Case:
    return Case("repairs", name, ("adopt", "m.json", "-o", "new"), {"m.json": text})
