"""What a search leaves to be answered, whatever the evidence."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording

from rulec.effects.candidate import Candidate
from rulec.mismatch.candidate_sets import CandidateSet
from rulec.mismatch.evidence.model import Model
from rulec.mismatch.evidence.samples import Samples
from rulec.mismatch.inference.prove import Proof
from rulec.mismatch.inference.series import Predicted
from rulec.mismatch.result import (
    Evidence,
    Finding,
    Fit,
    HiddenDriver,
    Location,
    OfRecording,
    Repair,
    Update,
)
from rulec.mismatch.search.accepted import Accepted
from rulec.mismatch.search.settled.sets import Posterior

F = TypeVar("F")


@dataclass(frozen=True, kw_only=True)
class NotComparable:
    """Nothing can be compared: why, what to do, and what was read all the same."""

    why: str
    next: str
    samples: Samples | None
    evidence: tuple[Evidence, ...]


@dataclass(frozen=True)
class Plants:
    """Readings by the shipped, the recalibrated and the repaired plant, per row of the recording.

    Each is a table by signal, shape (rows,), SI; the last is None where it cannot be written or
    simulated, which `refused` tells.
    """

    shipped: Mapping[str, Array]
    recalibrated: Mapping[str, Array]
    repaired: Mapping[str, Array] | None
    rulesets: tuple[Ruleset, Ruleset, Ruleset]
    refused: str = ""

    @property
    def signals(self) -> tuple[str, ...]:
        """What all of them predict."""
        return tuple(n for n in self.shipped if n in self.recalibrated and n in self.last)

    @property
    def last(self) -> Mapping[str, Array]:
        """Readings by the repaired plant, else by the recalibrated one, shape (rows,), SI."""
        return self.recalibrated if self.repaired is None else self.repaired


@dataclass(frozen=True, kw_only=True)
class Refits(Generic[F]):
    """The recalibrated and the repaired model as they are written, and what was left out.

    `repairs` say what to write of each. `left_out` has ids with reasons. `judged`, shape (n,),
    flags samples whose errors count.
    """

    plain: F
    repaired: F
    repairs: tuple[Repair, Repair]
    left_out: tuple[tuple[str, str], ...]
    judged: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Reading:
    """A reading with its errors, and at the samples, shape (n,), SI, what was measured and what
    the three plants predict."""

    fit: Fit
    measured: Array
    predicted: Predicted


@dataclass(frozen=True, kw_only=True)
class Explained(ABC, Generic[F]):
    """A recording explained as far as the search goes.

    `places` have no name for what is wrong there; `failing` are sensors that fail to read. `noise`
    says how large noise is, `untimed` what has no common time, where that is so. `standing` are
    the sets of explanations that are still possible, the likeliest first. Of several recordings
    `recordings` has each, and `changed` what each further one changed. `nothing` is the probability
    that nothing is left out by `posterior`, what all sets say; `believed` are the values of
    parameters with what was found, SI.
    """

    recording: Recording
    model: Model
    accepted: tuple[Accepted, ...]
    failing: tuple[Finding, ...]
    places: tuple[Location, ...]
    hidden: HiddenDriver | None
    tried: int
    posterior: Posterior
    noise: str
    untimed: str
    standing: tuple[CandidateSet, ...] = ()
    recordings: tuple[OfRecording, ...] = ()
    changed: tuple[Update, ...] = ()
    nothing: float = 1.0
    believed: Mapping[str, float] = field(default_factory=dict)

    def allowed(self, signal: str) -> float:
        """Error of a reading that sensors within their class, and laws within their accuracy,
        explain in 19 of 20 recordings, SI; infinite where it is not known."""
        return float("inf")

    @abstractmethod
    def proofs(self, findings: Sequence[Finding]) -> list[Proof]:
        """Open the held-out blocks, once; one proof per reading, the most telling first."""

    @abstractmethod
    def refitted(
        self, taken: Sequence[Candidate], left_out: Sequence[tuple[Candidate, str]]
    ) -> Refits[F]:
        """Fit what may be written, and the plain model, with sensors as they are."""

    @abstractmethod
    def readings(
        self, plants: Plants | None, refits: Refits[F], proofs: Sequence[Proof]
    ) -> list[Reading]:
        """Errors by simulation, else by the relations of the analysis."""

    @abstractmethod
    def rows_used(self, proofs: Sequence[Proof]) -> tuple[Evidence, ...]:
        """What each row of the recording served for."""

    @abstractmethod
    def notes(
        self, refits: Refits[F], proofs: Sequence[Proof], fits: Sequence[Fit], why: str
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Remarks before and behind those on the recording; `why` no plant was simulated."""
