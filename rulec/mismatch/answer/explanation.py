"""The result of a search, as needed for the answer, for any evidence."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording

from rulec.effects.candidate import Candidate, CurveTerm
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
from rulec.mismatch.search.settled.grow_sets import Posterior

F = TypeVar("F")


@dataclass(frozen=True, kw_only=True)
class NotComparable:
    """Nothing can be compared: why, what to do, and what was read nevertheless."""

    why: str
    next: str
    samples: Samples | None
    evidence: tuple[Evidence, ...]


@dataclass(frozen=True)
class Plants:
    """Readings by the shipped, the recalibrated and the repaired plant, per row of the recording.

    Each is a table by signal, shape (rows,), SI. `repaired` is None if it cannot be written or
    simulated, for the reason `refused`.
    """

    shipped: Mapping[str, Array]
    recalibrated: Mapping[str, Array]
    repaired: Mapping[str, Array] | None
    rulesets: tuple[Ruleset, Ruleset, Ruleset]
    refused: str = ""

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that all of them predict."""
        return tuple(n for n in self.shipped if n in self.recalibrated and n in self.last)

    @property
    def last(self) -> Mapping[str, Array]:
        """Readings by the repaired plant, else by the recalibrated one, shape (rows,), SI."""
        return self.recalibrated if self.repaired is None else self.repaired


@dataclass(frozen=True, kw_only=True)
class Refits(Generic[F]):
    """The recalibrated and the repaired model as they are written, and what was left out.

    `repairs` are the values to write of each. `left_out` has ids with reasons. `judged`, shape
    (n,), flags samples whose errors count.
    """

    plain: F
    repaired: F
    repairs: tuple[Repair, Repair]
    left_out: tuple[tuple[str, str], ...]
    judged: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Reading:
    """A reading with its errors; measured and predicted at the samples, shape (n,), SI."""

    fit: Fit
    measured: Array
    predicted: Predicted


@dataclass(frozen=True, kw_only=True)
class Explained(ABC, Generic[F]):
    """A recording as far as the search explains it.

    `places` are without a named cause, `failing` are failing sensors. `noise` describes the size of
    the noise, `untimed` what lacks a common time, if so. `standing` are the sets of explanations
    that are still possible, most probable first. Of several recordings, `recordings` has each, and
    `changed` the change by each further one. `nothing` is the probability by `posterior`, over all
    sets, that nothing is missing; `believed` are the values of parameters with the explanation
    found, SI; `curves` are the nameless terms of the most probable set that a module type can hold.
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
    curves: tuple[CurveTerm, ...] = ()

    def allowed(self, signal: str) -> float:
        """Error of a reading that sensors within their class and laws within their accuracy explain
        in 95 % of recordings, SI; infinite if unknown."""
        return float("inf")

    def evidence_per_row(self) -> tuple[float, int]:
        """Log odds of the likeliest set per reading, nats, with readings in SI, and their number;
        (nan, 0) where other ways to read the recording cannot be compared."""
        return float("nan"), 0

    @abstractmethod
    def proofs(self, findings: Sequence[Finding]) -> list[Proof]:
        """Open the held-out blocks, once; one proof per reading, the most significant first."""

    @abstractmethod
    def refitted(
        self, taken: Sequence[Candidate], left_out: Sequence[tuple[Candidate, str]]
    ) -> Refits[F]:
        """Fit what may be written, and the plain model, without corrections of sensors."""

    @abstractmethod
    def readings(
        self, plants: Plants | None, refits: Refits[F], proofs: Sequence[Proof]
    ) -> list[Reading]:
        """Errors by simulation, else by the relations of the analysis."""

    @abstractmethod
    def rows_used(self, proofs: Sequence[Proof]) -> tuple[Evidence, ...]:
        """What each row of the recording was used for."""

    @abstractmethod
    def notes(
        self, refits: Refits[F], proofs: Sequence[Proof], fits: Sequence[Fit], why: str
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Notes before and after those on the recording; `why` no plant was simulated."""
