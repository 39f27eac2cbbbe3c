"""From answers to counts, and to their machine form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tests.figures.share import Share
from tests.rig.mixing_rig.judge import Answer, Judged
from tests.rig.mixing_rig.measure import CERTAIN, grouped


def counted(answers: Sequence[Answer]) -> dict[str, Any]:
    """Shares of all plateaus; `covered` of those where the right fault is named first.

    `first`: the most probable fault is the true one. `mentioned`: it is that one or among its
    alternatives. `surely_wrong`: another is named, more probable than CERTAIN, without mention of
    the true one. `unknown`: only that nothing known fits. `silent`: nothing is said.
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
    off = [a.named[0].degree - a.true[a.named[0].fault] for a in first]
    return {"points": len(answers), **forms, "error": _mean([abs(x) for x in off])}


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


def sound_form(judged: Judged) -> dict[str, Any]:
    """False alarms: samples inside findings, or inside what nothing known explains."""
    samples = sum(c.samples for c in judged.covered)
    fault, unknown = (sum(getattr(c, n) for c in judged.covered) for n in ("fault", "unknown"))
    return {
        "recordings": len(judged.covered),
        "recordings_with_fault": sum(bool(c.findings) for c in judged.covered),
        "samples": samples,
        "fault": Share(fault, samples).form(),
        "unknown": Share(unknown, samples).form(),
        "fault_per_100000": round(1e5 * fault / samples, 3),
        "named": sorted({name for c in judged.covered for name in c.findings}),
    }


def kind_of(answer: Answer) -> str:
    """The fault without its module: `P_el.low` of `A.P_el.low`."""
    (fault,) = answer.true
    return fault.partition(".")[2]


def _degree(answer: Answer) -> str:
    return f"{answer.set_degree:g}"


def _by(answers: Sequence[Answer], key: Any) -> dict[str, Any]:
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


def _mean(values: Sequence[float]) -> float | None:
    return round(sum(values) / len(values), 5) if values else None
