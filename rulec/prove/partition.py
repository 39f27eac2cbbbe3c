"""The cases of a run, planned but not simulated. One seed on one machine gives the same bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import yaml

from rulec.prove.truth import contacts
from rulec.prove.truth.sealed import Case
from rulec.prove.truth.settled import suite as stationary
from rulec.prove.truth.tanks import suite as dynamic

REGISTER = Path(__file__).parent / "partitions.yaml"


class Planned(Protocol):
    """A planned case."""

    @property
    def name(self) -> str:
        """Unique in a run."""

    @property
    def group(self) -> str:
        """What kind of case it is."""

    def make(self) -> Case:
        """Simulate it; ValueError where no plant shows it."""


DYNAMIC_FULL: Mapping[str, int] = {
    "clean": 100,
    "single": 22,
    "corner": 5,
    "sensor": 6,
    "fault": 6,
    "unnamed": 5,
    "pair": 4,
    "hiding": 5,
    "alike": 4,
}

DYNAMIC_QUICK: Mapping[str, int] = {"clean": 9, "single": 3, "sensor": 1}
DYNAMIC_HARD_QUICK: Mapping[str, int] = dict.fromkeys(dynamic.HARD, 1)
SHORT = 256
"""Samples of a dynamic case of a quick run."""


@dataclass(frozen=True)
class Partition:
    """Cases by seed; `name` is `development` or `final`; `only` those whose name holds a word;
    `hard` cases with difficulties instead of the others; `produced` plants that make few
    products; `contacts` first contacts."""

    name: str
    seed: int
    quick: bool = False
    only: str = ""
    # Not in the digest of the other runs; names of cases tell these apart.
    hard: bool = field(default=False, repr=False)
    produced: bool = field(default=False, repr=False)
    contacts: bool = field(default=False, repr=False)

    @property
    def digest(self) -> str:
        """Hash that differs between runs, also where the list of cases has changed."""
        names = "\n".join([repr(self), *(case.name for case in self.cases())])
        return hashlib.sha256(names.encode()).hexdigest()

    def cases(self) -> list[Planned]:
        """All of them in random order, so that numbers of folders reveal nothing."""
        found = list(self._in_order())
        order = np.random.default_rng([self.seed, 7]).permutation(len(found))
        return [found[i] for i in order if self.only in found[i].name]

    def _in_order(self) -> Iterator[Planned]:
        if self.contacts:
            count = contacts.QUICK if self.quick else contacts.CASES
            yield from contacts.planned(self.seed, count)
            return
        if self.produced:
            yield from stationary.planned(self.seed, stationary.PRODUCED, small=True)
            return
        if self.hard:
            counts = stationary.HARD_QUICK if self.quick else stationary.HARD
            yield from stationary.planned(self.seed, counts, self.quick)
            if self.quick:
                yield from dynamic.cases(self.seed, DYNAMIC_HARD_QUICK, SHORT, own=1.0)
            else:
                yield from dynamic.cases(self.seed, dynamic.HARD)
            return
        full = not self.quick
        settled = stationary.FULL if full else stationary.QUICK
        yield from stationary.planned(self.seed, settled, self.quick)
        if full:
            yield from dynamic.cases(self.seed, DYNAMIC_FULL)
        else:
            yield from dynamic.cases(self.seed, DYNAMIC_QUICK, SHORT, own=1.0)


def register() -> Mapping[str, Any]:
    """Seeds of the partitions, and how often each was opened."""
    found: Mapping[str, Any] = yaml.safe_load(REGISTER.read_text(encoding="utf-8"))
    return found
