"""From answers to figures, as the plain data that the commands print."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from tests.figures.ledger import Share
from tests.rig.mixing_rig.judge import Answer, Covered, Judged, Samples

REMARKS = ("ok", "unknown", "cannot judge", "moving")
"""Verdicts on a sample that name no fault."""

One = TypeVar("One")
Key = TypeVar("Key", bound=Hashable)


def sample_figures(parts: Sequence[Samples], fault: str) -> dict[str, float]:
    """Each sample judged on its own: mean error of the degree of those on plateaus with a fault
    that is named, and share of healthy ones that are called faulty. Transients and what the tool
    calls moving are left out."""
    true, degree = (np.concatenate([getattr(p, n) for p in parts]) for n in ("true", "degree"))
    verdict = np.concatenate([np.array(p.verdict) for p in parts])
    settled = verdict != "moving"
    named = settled & (true > 0.05) & (verdict == fault)
    healthy = settled & (true < 1e-3)
    return {
        "error": _mean(np.abs(degree[named] - true[named])),
        "alarmed": _mean(~np.isin(verdict[healthy], REMARKS)),
    }


def counted(answers: Sequence[Answer]) -> dict[str, Any]:
    """`first`: share of plateaus whose most probable fault is the true one. `error` is that of the
    degree there, `error_any` where any fault is named."""
    first = [a for a in answers if _is_first(a)]
    errors = {"error": _error(first), "error_any": _error([a for a in answers if a.named])}
    return {"first": Share(len(first), len(answers)).form(), **errors}


def start_form(judged: Judged) -> dict[str, Any]:
    by_degree = grouped(judged.answers, lambda a: f"{a.set_degree:g}")
    return {"degree": {degree: counted(part) for degree, part in by_degree.items()}}


def sound_form(covered: Sequence[Covered]) -> dict[str, Any]:
    """False alarms: samples inside findings, or inside what nothing known explains."""
    samples = sum(c.samples for c in covered)
    fault, unknown = (sum(getattr(c, n) for c in covered) for n in ("fault", "unknown"))
    return {"fault": Share(fault, samples).form(), "unknown": Share(unknown, samples).form()}


def leakage_form(judged: Judged) -> dict[str, Any]:
    form: dict[str, Any] = {}
    for (plant, mode), parts in grouped(judged.samples, lambda s: (s.group, s.mode)).items():
        form.setdefault(plant, {})[mode] = {"samples": sample_figures(parts, "A.leakage")}
    return form


def degrees_form(judged: Judged) -> dict[str, Any]:
    """All faults, by mode; `right` is the share named first."""
    form = {}
    for mode, answers in grouped(judged.answers, lambda a: a.mode).items():
        found = counted(answers)
        form[mode] = {"right": found.pop("first"), **found}
    return form


def alarms_form(judged: Judged) -> dict[str, Any]:
    by_mode = grouped(judged.covered, lambda c: c.mode)
    return {mode: sound_form(covered) for mode, covered in by_mode.items()}


FORMS: Mapping[str, Callable[[Judged], dict[str, Any]]] = {
    "leakage": leakage_form,
    "degrees": degrees_form,
    "alarms": alarms_form,
    "sound-start": start_form,
    "sound": alarms_form,
}


def grouped(found: Iterable[One], key: Callable[[One], Key]) -> Mapping[Key, list[One]]:
    """By what `key` says, in order of the first."""
    groups: dict[Key, list[One]] = {}
    for one in found:
        groups.setdefault(key(one), []).append(one)
    return groups


def _is_first(answer: Answer) -> bool:
    return bool(answer.named) and answer.named[0][0] in answer.true


def _error(answers: Sequence[Answer]) -> float | None:
    """Mean error of the degree of the fault named first, against the true one's."""
    off = [abs(a.named[0][1] - next(iter(a.true.values()))) for a in answers]
    return sum(off) / len(off) if off else None


def _mean(values: Array | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
