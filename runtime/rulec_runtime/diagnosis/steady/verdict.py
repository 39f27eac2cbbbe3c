"""Verdicts: what each operating point shows on its own."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.ruleset import ObserverSpec
from rulec_runtime.contract.threshold import threshold_of
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.observe import NOT_RECORDED, below_minimum, reason, too_vague
from rulec_runtime.diagnosis.steady.points import at_rest

Off = tuple[str, float, float]
"""A residual with its size and its threshold, as shares of a flow."""

NAMED = 4
"""Faults named in a remark."""


@dataclass(frozen=True)
class Verdict:
    """Verdict on one stretch: ``ok``, ``fault`` (with the indexes of one fault, or of two at once),
    ``unknown``, ``outside`` the calibrated range, or ``blind``; `lost` and `rests` as in
    `Period`."""

    kind: str
    faults: tuple[int, ...]
    text: str
    lost: bool = False
    rests: bool = False


def verdict_at(evaluated: EvaluatedPoints, point: int) -> Verdict:
    """The verdict on one stretch."""
    ruleset = evaluated.part.ruleset
    observed, isolation = evaluated.observed, evaluated.isolation
    if not isolation.judged[point]:
        if because := standstill(evaluated, point):
            return Verdict("blind", (), because, rests=True)
        because = why_blind(evaluated, point) or "too few estimates of the same flow"
        return Verdict("blind", (), because, only_lost(evaluated, point))
    if not isolation.deviating[point]:
        return Verdict("ok", (), "")
    chances = isolation.probability[:, point]
    if chances.max(initial=0.0) <= 0:
        outside = [name for name, flags in observed.extrapolated.items() if flags[point]]
        if outside:
            signal = ruleset.signal_by_id[outside[0]]
            assert signal.valid_from is not None
            assert signal.valid_to is not None
            low, high = signal.shown(signal.valid_from), signal.shown(signal.valid_to)
            text = (
                f"nothing known fits: the estimates of the flow disagree while {signal.id} is "
                f"outside {low:.4g} to {high:.4g} {signal.unit}, the range that its equations "
                "hold for"
            )
            return Verdict("outside", (), text)
        names = ", ".join(name for name, _, _ in disagreeing(evaluated, point))
        names = names or "the residuals together"
        text = (
            f"nothing known fits: {names} deviate in a way that neither one fault nor two explain"
        )
        return Verdict("unknown", (), text)
    pair = tuple(int(i) for i in isolation.pair[point])
    return Verdict("fault", (int(np.argmax(chances * ruleset.odds)),) if pair[0] < 0 else pair, "")


def why_blind(evaluated: EvaluatedPoints, point: int) -> str:
    """Why estimates of a part are unusable at a point; empty if all are usable."""
    ruleset, observed = evaluated.part.ruleset, evaluated.observed
    vague = too_vague(ruleset, observed, slice(point, point + 1))[:, 0]
    reasons = [
        f"{ruleset.observers[i].id}: its parameters are not known well enough; calibrate the plant"
        if vague[i]
        else reason(ruleset, observed, i, point)
        for i in np.flatnonzero(~observed.valid[:, point]).tolist()
    ]
    points = observed.points
    taken_out = (name for name, flags in points.stood_in.items() if flags[point])
    reasons += [f"{name}: {points.why[name]}" for name in taken_out]
    lost = dict.fromkeys(one for one in reasons if one.endswith(NOT_RECORDED))
    names = ", ".join(one.removesuffix(NOT_RECORDED) for one in lost)
    others = dict.fromkeys(one for one in reasons if one not in lost)
    return "; ".join([*[names + NOT_RECORDED] * bool(lost), *others])


def standstill(evaluated: EvaluatedPoints, point: int) -> str:
    """Why an unjudged point is one at which modules stand; empty if something else is the reason.

    Modules stand if an input is below its minimum. If all stand, no other reading matters.
    """
    ruleset, values = evaluated.part.ruleset, evaluated.observed.points.values
    bounded = [s for s in ruleset.signals if s.minimum is not None and s.id in ruleset.observed]
    low = [s for s in bounded if s.id in values and values[s.id][point] < s.minimum]
    stand = {s.id.partition(".")[0]: s for s in reversed(low) if s.is_input}
    run = {s.id.partition(".")[0] for s in bounded if s.is_input} - stand.keys()
    rest = at_rest(ruleset, frozenset(signal.id for signal in low))
    others = run and any(o.id not in rest for o in _unusable(evaluated, point))
    if (stand and not others) or len(rest) == len(ruleset.observers):
        shown = reversed(stand.values()) if stand else low
        return "at standstill: " + ", ".join(map(below_minimum, shown))
    return ""


def only_lost(evaluated: EvaluatedPoints, point: int) -> bool:
    """Whether all estimates that are unusable at a point lack a reading."""
    return not any(_unusable(evaluated, point))


def _unusable(evaluated: EvaluatedPoints, point: int) -> Iterator[ObserverSpec]:
    """Estimates that are unusable at a point although no reading of theirs is missing."""
    ruleset, values = evaluated.part.ruleset, evaluated.observed.points.values
    missing = {name for name, column in values.items() if not np.isfinite(column[point])}
    missing |= ruleset.observed - values.keys()
    for i in np.flatnonzero(~evaluated.observed.valid[:, point]).tolist():
        if missing.isdisjoint(ruleset.observers[i].signals):
            yield ruleset.observers[i]


def partly_blind(evaluated: EvaluatedPoints, point: int) -> str:
    """Which faults a judged point could not show, and why; empty if all.

    Errors of readings that the recording has not at all are none of them.
    """
    isolation, ruleset = evaluated.isolation, evaluated.part.ruleset
    because = why_blind(evaluated, point) if isolation.judged[point] else ""
    absent = ruleset.observed - evaluated.observed.points.values.keys()
    unseen = [
        f.id
        for f, x in zip(ruleset.faults, isolation.floor[:, point], strict=True)
        if not (f.unlisted or threshold_of(x) < f.highest)
        and not (f.in_sensor and absent.issuperset(f.scales))
    ]
    if not because or not unseen:
        return ""
    names = ", ".join(unseen[:NAMED]) + (", ..." if len(unseen) > NAMED else "")
    return f"in part: {because}; cannot detect {names}"


def shown_without(evaluated: Iterable[EvaluatedPoints]) -> Iterator[str]:
    """Faults that are detectable despite removed readings, thanks to stand-ins."""
    for one in evaluated:
        flags = one.observed.points.stood_in.values()
        where = np.flatnonzero(np.any([*flags], axis=0) & one.isolation.judged) if flags else ()
        if len(where):
            for fault, floor in zip(one.part.ruleset.faults, one.isolation.floor, strict=True):
                if all(threshold_of(x) < fault.highest for x in floor[where].tolist()):
                    yield fault.id


def disagreeing(evaluated: EvaluatedPoints, point: int) -> tuple[Off, ...]:
    """Residuals beyond their thresholds at a point, at most three, the farthest first; each with
    its size and its threshold, as shares of the flow that it is a part of."""
    observed, ruleset = evaluated.observed, evaluated.part.ruleset
    value, u = observed.residuals[:, point], observed.residual_u[:, point]
    ratio = np.abs(value) / u
    ratio[~np.isfinite(ratio)] = 0.0
    found = []
    for i in np.argsort(-ratio)[:3]:
        if ratio[i] > threshold_of(1.0):
            residual = ruleset.residuals[i]
            part = ruleset.observer_index[residual.terms[-1].observer]
            flow = abs(float(observed.flows[part, point]))
            found.append((residual.id, float(value[i]) / flow, threshold_of(float(u[i])) / flow))
    return tuple(found)
