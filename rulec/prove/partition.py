"""The cases of a run, planned but not simulated. One seed on one machine gives the same bytes."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import yaml

from rulec.prove.truth import contacts
from rulec.prove.truth.kinds import counts
from rulec.prove.truth.sealed import Case
from rulec.prove.truth.settled import suite as stationary
from rulec.prove.truth.tanks import suite as dynamic

REGISTER = Path(__file__).parent / "partitions.yaml"


class Planned(Protocol):
    """A planned case."""

    @property
    def name(self) -> str:
        """Unique in a run."""

    def make(self) -> Case:
        """Simulate it; raises ValueError if no plant shows its effects."""


SHORT = 256
"""Samples of a dynamic case of a quick run."""


@dataclass(frozen=True)
class Partition:
    """Cases by seed; `name` is `development` or `final`.

    `only` keeps the cases whose name contains it. Instead of ordinary cases, `hard` takes cases
    with difficulties, `produced` plants that make few products, `contacts` first contacts.
    """

    name: str
    seed: int
    quick: bool = False
    only: str = ""
    # Not in `repr`, so not in the digest of other runs; the names of their cases differ anyway.
    hard: bool = field(default=False, repr=False)
    produced: bool = field(default=False, repr=False)
    contacts: bool = field(default=False, repr=False)

    @property
    def digest(self) -> str:
        """Hash that differs between runs, and if the list of cases has changed."""
        names = "\n".join([repr(self), *(case.name for case in self.cases())])
        return hashlib.sha256(names.encode()).hexdigest()

    def cases(self) -> list[Planned]:
        """Return all cases in random order, so that the numbers of folders reveal nothing."""
        found = list(self._in_order())
        order = np.random.default_rng([self.seed, 7]).permutation(len(found))
        return [found[i] for i in order if self.only in found[i].name]

    def _in_order(self) -> Iterator[Planned]:
        if self.contacts:
            count = contacts.QUICK if self.quick else contacts.CASES
            yield from contacts.planned(self.seed, count)
        elif self.produced:
            yield from stationary.planned(self.seed, counts("settled", "produced"), small=True)
        else:
            words = ("hard",) * self.hard + ("quick",) * self.quick
            run, small = "_".join(words) or "full", self.quick
            yield from stationary.planned(self.seed, counts("settled", run), small)
            tanks = counts("tanks", run)
            if small:
                yield from dynamic.cases(self.seed, tanks, SHORT, own=1.0)
            else:
                yield from dynamic.cases(self.seed, tanks)


def register() -> Mapping[str, Any]:
    """Return the seeds of the partitions, and how often each was opened."""
    found: Mapping[str, Any] = yaml.safe_load(REGISTER.read_text(encoding="utf-8"))
    return found
