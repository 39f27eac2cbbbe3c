"""The answer put together, whatever the evidence: verdict, what to do, and what may be written."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording

from rulec.effects.candidate import Missing
from rulec.mismatch.answer.public import Plants, checks_of, refusal
from rulec.mismatch.answer.verdict import headline_of, next_step, remainder_of, verdict_of
from rulec.mismatch.result import (
    Confounded,
    Curves,
    Evidence,
    Finding,
    Fit,
    HiddenDriver,
    Location,
    Mismatch,
    Repair,
    Series,
)


@dataclass(frozen=True, kw_only=True)
class Explained:
    """What an analysis found, and how it looked.

    `unnamed`: something without a name is left. `plants` were simulated, None where none can be.
    `heldout` are spans of time, s. `begin` is when it began, by `time.perf_counter`.
    """

    findings: tuple[Finding, ...]
    locations: tuple[Location, ...]
    unnamed: bool
    hidden: HiddenDriver | None
    missing: Sequence[Missing]
    confounded: tuple[Confounded, ...]
    untested: tuple[str, ...]
    fits: tuple[Fit, ...]
    plants: Plants | None
    repairs: tuple[Repair, Repair]
    left_out: tuple[tuple[str, str], ...]
    heldout: Sequence[tuple[float, float]]
    curves: Curves | None
    series: Series
    evidence: tuple[Evidence, ...]
    notes: tuple[str, ...]
    split: str
    digest: str
    noise: str
    tried: int
    begin: float


def answered(recording: Recording, ruleset: Ruleset, found: Explained) -> Mismatch:
    """The answer; nothing is searched or fitted any more."""
    verdict = verdict_of(found.findings, found.unnamed)
    plain, repair = found.repairs
    plants, fits = found.plants, found.fits
    checks = checks_of(plants, recording, found.heldout) if plants else ()
    unwritten = plants.refused if plants else ""
    refused = refusal(verdict, fits, repair.joined, unwritten, checks)
    headline = headline_of(verdict, found.findings, found.locations)
    return Mismatch(
        plant=ruleset.plant,
        title=ruleset.title,
        recording="",
        verdict=verdict,
        headline=headline + remainder_of(verdict, fits),
        locations=found.locations,
        findings=found.findings,
        fit=fits[0] if fits else None,
        fits=fits,
        confounded=found.confounded,
        hidden=found.hidden,
        untested=found.untested,
        next=next_step(verdict, found.findings, found.hidden, found.missing, refused),
        split=found.split,
        digest=found.digest,
        noise=found.noise,
        tried=found.tried,
        notes=found.notes,
        joined=repair.joined,
        parameters=repair.parameters,
        covariance=repair.covariance,
        curves=found.curves,
        seconds=time.perf_counter() - found.begin,
        fixed=repair.fixed,
        misfit=repair.misfit,
        ranges=repair.ranges,
        series=found.series,
        evidence=found.evidence,
        left_out=found.left_out,
        refused=refused,
        plain=plain,
        checks=checks,
    )
