"""A seed draws the same recording in every version: what is added to the suite changes no case."""

import hashlib
from pathlib import Path

import pytest

from rulec.prove.truth.sealed import Case
from rulec.prove.truth.settled.suite import planned
from rulec.prove.truth.tanks.suite import cases

SETTLED = {
    "clean": "5453fca014104332",
    "single": "e0eb34c8a63c1387",
    "all": "9fdc480485587188",
    "form": "623b24e1ad689d64",
    "coloured": "7f073bd357b0c743",
    "drift": "6a972c738b405bc6",
}
"""First digits of the hash over all files of the first small case of seed 1, by group."""

TANKS = {"clean": "c7fb516570f85bc3", "single": "efb7d5f5c8d9434d"}
"""The same of tanks."""


def digest_of(case: Case, folder: Path) -> str:
    """Over plant and recording."""
    case.write(folder)
    files = (p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file())
    return hashlib.sha256(b"".join(files)).hexdigest()[:16]


@pytest.mark.parametrize("group", SETTLED)
def test_settled_plants_are_as_they_were(group: str, tmp_path: Path) -> None:
    (case,) = planned(1, {group: 1}, small=True)
    assert digest_of(case.make(), tmp_path) == SETTLED[group]


@pytest.mark.parametrize("group", TANKS)
def test_tanks_are_as_they_were(group: str, tmp_path: Path) -> None:
    (case,) = cases(1, {group: 1}, 256, own=1.0)
    assert digest_of(case.make(), tmp_path) == TANKS[group]
