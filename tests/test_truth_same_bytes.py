"""A seed draws the same recording in every version, with the same answer: what is added to the
suite changes no case. All that is drawn is held here, however it is distributed."""

import hashlib
import json
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from rulec.prove.truth.sealed import Case
from rulec.prove.truth.settled import suite as settled
from rulec.prove.truth.tanks import suite as tanks

SETTLED = {
    "clean": "5453fca014104332 cc7e7dab2328fe61",
    "single": "e0eb34c8a63c1387 a3c5b5347b80285b",
    "calibrated": "20f7fdef815faad4 7a2c1ed0c260deca",
    "correlated": "83e0a0f259532a43 d25db57732e0eda1",
    "sensor": "b4d549c5311d108f 87b0fee6ca3d747c",
    "fault": "6326ec7d7be90d9b cb09257e5722f251",
    "unnamed": "16709d3cc560dd7a 8d398a3116b72ce4",
    "unrecorded": "21ea3c01ba1833c0 95b050b95de379e0",
    "pair": "0ffcc57a72538cba 7d951fcf58f0ae1c",
    "hiding": "9a247826241ca4af 91600e61039b1de8",
    "form-clean": "07cfc91c3ea356ae 29407df21316838d",
    "form": "623b24e1ad689d64 833846004654f4f5",
    "coloured-clean": "b6182c90eb872140 00a5ff12eced8a34",
    "coloured": "7f073bd357b0c743 cbce7a6e2821dc2f",
    "drift-clean": "b20fff93211d6205 34f3d4917487bc90",
    "drift": "6a972c738b405bc6 091a1915836ec5b2",
    "all-clean": "635012faf06a7509 faba5460ec9fdd9d",
    "all": "9fdc480485587188 9799a72c406f7b9b",
    "wiring": "618d294852080df9 7dd8ea2229af33e7",
    "production": "af2a3c3f1dcd0e34 ed684843192498a4",
    "production-clean": "73fbaf8a7a8b2cdc 33e6381677beab65",
    "production-unnamed": "14b433ff586f2b91 1c737def4c2351d1",
}
"""First digits of the hash over all files of the first small case of seed 1, by group, and over
its answer."""

TANKS = {
    "clean": "c7fb516570f85bc3 7216d2f2a3bae98f",
    "single": "efb7d5f5c8d9434d ff4455ec3dd01c97",
    "corner": "bd46f9f0b84617ca 57926b0c5cdec29c",
    "sensor": "ae4099ebd9db97bd b0bc36ea01d3810a",
    "fault": "035404f5a8804fce 9ee78b9ad54d6111",
    "unnamed": "42442a49dbad4585 77c6538d017b3b2e",
    "pair": "9f880f79fa9d885e 2fcf14b4d39f4db5",
    "hiding": "1ef030ef791b94e0 a4d53522cab596c8",
    "alike": "2595dde4d59e98c1 8c036f272f0793d9",
    "form-clean": "fe2160980e087d7f 06f3448d6b0bd3e2",
    "form": "292a65a7ea8337d9 d9533f81411a2b0c",
    "coloured-clean": "2ed1525c836bb6cc dd40db63291cc7c9",
    "coloured": "6a62031e30901b8b dffb6565fe40a90b",
    "drift-clean": "62155828bb45e6d7 ac88f66ce3551e33",
    "drift": "f4c1ea49b1c9361d 8ce9ba35cf2f22e0",
    "all-clean": "c544e6b3c9bdb6b0 1f5aaf1957c6f9ce",
    "all": "d56e9943248f2507 0cad095ee61969e5",
}
"""The same of tanks, of 256 samples."""

PLANNED = {"settled": "5e597b561547797d", "tanks": "31027c685575bb0b"}
"""Of the list of cases of seed 3: plants, operation, effects, strengths."""


def digest_of(case: Case, folder: Path) -> str:
    """Over plant and recording."""
    case.write(folder)
    files = (p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file())
    return _digits(b"".join(files))


def _digits(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def content_of(case: Case) -> str:
    """Over the answer, numbers to three digits: machines round differently."""
    answer = json.loads(case.answer.to_json(), parse_float=lambda text: f"{float(text):.2e}")
    return _digits(json.dumps(answer, sort_keys=True).encode())


def both_of(case: Case, folder: Path) -> str:
    return f"{digest_of(case, folder)} {content_of(case)}"


@pytest.mark.parametrize("group", SETTLED)
def test_settled_plants_are_as_they_were(group: str, tmp_path: Path) -> None:
    (case,) = settled.planned(1, {group: 1}, small=True)
    assert both_of(case.make(), tmp_path) == SETTLED[group]


@pytest.mark.parametrize("group", TANKS)
def test_tanks_are_as_they_were(group: str, tmp_path: Path) -> None:
    (case,) = tanks.cases(1, {group: 1}, 256, own=1.0)
    assert both_of(case.make(), tmp_path) == TANKS[group]


def test_the_suite_is_as_it_was() -> None:
    """With as many cases as it says, each with a name of its own."""
    groups = {**settled.FULL, **settled.HARD, **settled.PRODUCED}
    assert groups["clean"] >= 100
    lists: dict[str, list[Any]] = {
        "settled": [*settled.planned(3, groups)],
        "tanks": [*tanks.cases(3, dict.fromkeys(TANKS, 8))],
    }
    found = {half: _digits(repr(planned).encode()) for half, planned in lists.items()}
    assert found == PLANNED
    names = [case.name for case in chain(*lists.values())]
    assert len(set(names)) == len(names) == sum(groups.values()) + 8 * len(TANKS)
