"""From answers to figures, as the plain data that the commands print."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from tests.figures.share import Share
from tests.rig.mixing_rig.judge import Answer, Covered, Judged, Samples

CERTAIN = 0.95
REMARKS = ("ok", "unknown", "cannot judge", "moving")
"""Verdicts on a sample that name no fault."""


@dataclass(frozen=True)
class SampleFigures:
    """Of all samples on plateaus with a fault, each judged on its own.

    `named`: share of them. Errors, bias, bounds: of those. `alarmed`: share of healthy samples.
    """

    faulty: int
    named: float
    error: float
    bias: float
    covered: float
    healthy: int
    alarmed: float


def sample_figures(parts: Sequence[Samples], fault: str) -> SampleFigures:
    """Figures of a replay; transients and what the tool calls moving are left out."""
    true, degree, lower, upper = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("true", "degree", "lower", "upper")
    )
    verdict = np.concatenate([np.array(p.verdict) for p in parts])
    settled = verdict != "moving"
    faulty = settled & (true > 0.05)
    named = faulty & (verdict == fault)
    healthy = settled & (true < 1e-3)
    off = degree[named] - true[named]
    return SampleFigures(
        int(faulty.sum()),
        _mean(verdict[faulty] == fault),
        _mean(np.abs(off)),
        _mean(off),
        _mean((lower[named] <= true[named]) & (true[named] <= upper[named])),
        int(healthy.sum()),
        _mean(~np.isin(verdict[healthy], REMARKS)),
    )


def counted(answers: Sequence[Answer]) -> dict[str, Any]:
    """Shares of all plateaus; `covered` of those where the right fault is named first.

    `first`: the most probable fault is the true one. `mentioned`: it is that one or among its
    alternatives. `surely_wrong`: another is named, more probable than CERTAIN, without mention of
    the true one. `unknown`: only that nothing known fits. `silent`: nothing is said. `error` is
    that of the degree where the right fault is named first, `error_any` where any is named.
    """
    first = [a for a in answers if _is_first(a)]
    shares = {
        "first": (len(first), answers),
        "mentioned": (sum(_is_mentioned(a) for a in answers), answers),
        "surely_wrong": (sum(_is_surely_wrong(a) for a in answers), answers),
        "unknown": (sum(not a.named and a.unknown for a in answers), answers),
        "silent": (sum(not a.named and not a.unknown for a in answers), answers),
        "covered": (sum(_is_covered(a) for a in first), first),
    }
    forms = {name: Share(count, len(of)).form() for name, (count, of) in shares.items()}
    errors = {"error": _error(first), "error_any": _error([a for a in answers if a.named])}
    return {"points": len(answers), **forms, **errors}


def table_form(judged: Judged) -> dict[str, Any]:
    """All, by degree, by kind of fault, by both; and every answer that does not name it first."""
    answers = judged.answers
    return {
        "all": counted(answers),
        "degree": _by(answers, _degree),
        "kind": _by(answers, kind_of),
        "kind_and_degree": _by(answers, lambda a: f"{kind_of(a)} {_degree(a)}"),
        "misses": [_miss(a) for a in answers if not _is_first(a)],
    }


def sound_form(covered: Sequence[Covered]) -> dict[str, Any]:
    """False alarms: samples inside findings, or inside what nothing known explains."""
    samples = sum(c.samples for c in covered)
    fault, unknown = (sum(getattr(c, n) for c in covered) for n in ("fault", "unknown"))
    return {
        "recordings": len(covered),
        "recordings_with_fault": sum(bool(c.findings) for c in covered),
        "samples": samples,
        "fault": Share(fault, samples).form(),
        "unknown": Share(unknown, samples).form(),
        "named": sorted({name for c in covered for name in c.findings}),
    }


def leakage_form(judged: Judged) -> dict[str, Any]:
    """Samples judged alone, by plant and mode."""
    form: dict[str, Any] = {}
    for plant, mode in dict.fromkeys((s.group, s.mode) for s in judged.samples):
        parts = [s for s in judged.samples if (s.group, s.mode) == (plant, mode)]
        alone = [sample_figures([part], "A.leakage").error for part in parts]
        figures = asdict(sample_figures(parts, "A.leakage"))
        spread = {"error_spread": float(np.std(alone))}  # from one calibration to the next
        form.setdefault(plant, {})[mode] = {"samples": figures | spread}
    return form


def degrees_form(judged: Judged) -> dict[str, Any]:
    """All faults, by mode; `right` is the share named first."""
    form = {}
    for mode, answers in grouped(judged.answers, lambda a: a.mode).items():
        found = counted(answers)
        form[mode] = {"right": found.pop("first"), **found}
    return form


def alarms_form(judged: Judged) -> dict[str, Any]:
    """False alarms by mode."""
    modes = dict.fromkeys(c.mode for c in judged.covered)
    return {mode: sound_form([c for c in judged.covered if c.mode == mode]) for mode in modes}


FORMS: Mapping[str, Callable[[Judged], dict[str, Any]]] = {
    "leakage": leakage_form,
    "degrees": degrees_form,
    "alarms": alarms_form,
}


def kind_of(answer: Answer) -> str:
    """The fault without its module: `P_el.low` of `A.P_el.low`."""
    (fault,) = answer.true
    return fault.partition(".")[2]


def grouped(answers: Iterable[Answer], key: Callable[[Answer], str]) -> Mapping[str, list[Answer]]:
    """Answers by what `key` says of them, in order of the first."""
    groups: dict[str, list[Answer]] = {}
    for answer in answers:
        groups.setdefault(key(answer), []).append(answer)
    return groups


def _degree(answer: Answer) -> str:
    return f"{answer.set_degree:g}"


def _by(answers: Sequence[Answer], key: Callable[[Answer], str]) -> dict[str, Any]:
    return {name: counted(part) for name, part in sorted(grouped(answers, key).items())}


def _is_first(answer: Answer) -> bool:
    return bool(answer.named) and answer.named[0].fault in answer.true


def _is_mentioned(answer: Answer) -> bool:
    return any({n.fault, *n.alternatives} & set(answer.true) for n in answer.named)


def _is_surely_wrong(answer: Answer) -> bool:
    return not _is_mentioned(answer) and any(n.probability > CERTAIN for n in answer.named)


def _is_covered(answer: Answer) -> bool:
    said = answer.named[0]
    return said.lower <= answer.true[said.fault] <= said.upper


def _error(answers: Sequence[Answer]) -> float | None:
    """Mean error of the degree of the fault named first, against the true one's."""
    off = [abs(a.named[0].degree - next(iter(a.true.values()))) for a in answers]
    return sum(off) / len(off) if off else None


def _miss(answer: Answer) -> Mapping[str, Any]:
    (fault,) = answer.true
    said = [f"{n.fault} {n.degree:.3f} at {n.probability:.0%}" for n in answer.named]
    otherwise = ["nothing known fits"] if answer.unknown else []
    return {
        "fault": fault,
        "degree": answer.set_degree,
        "seed": answer.case,
        "said": said or otherwise,
    }


def _mean(values: Array | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
