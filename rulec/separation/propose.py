"""The change of inputs that separates best within limits: of one input, or of more if necessary.

A *measure* says what separates, so the search knows neither faults nor physics.

Source: the design that maximises the smallest expected log Bayes factor, after Box and Hill 1967.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.limits import SAME_FLOW, SEPARATED
from rulec.separation import limits
from rulec.separation.allowed import Allowed

Point = Mapping[str, float]
"""Inputs that differ from the present point, as their sensors show them."""


@dataclass(frozen=True)
class Looked:
    """The results of a measure at n points, each together with the present one.

    `apart` has a row for each pair of faults, shape (rows, n), standard deviations; NaN where the
    plant cannot run. `flows` per module, m3/s, shape (n,).
    """

    apart: Array
    flows: Mapping[str, Array]


Measure = Callable[[Sequence[Point]], Looked]


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A change of inputs.

    `changes` are the values to set per input, as its sensor shows them; empty if no allowed change
    separates better than the present point. `here` and `apart` are standard deviations per row of
    the measure, without and with the change. `ramp` is the shortest duration of the change, `hold`
    that of the stay, s. `costs` names inputs and modules that cost product.
    """

    changes: Mapping[str, float]
    here: tuple[float, ...]
    apart: tuple[float, ...]
    ramp: float = 0.0
    hold: float = 0.0
    costs: tuple[str, ...] = ()

    @property
    def separated(self) -> int:
        """The number of pairs that it separates."""
        return sum(v >= SEPARATED for v in self.apart)

    @property
    def worth(self) -> tuple[int, int, float]:
        """The number of separated pairs counts first, then the costs, then the distances."""
        return self.separated, -len(self.costs), sum(self.apart)


def propose(allowed: Allowed, present: Mapping[str, float], measure: Measure) -> Proposal:
    """The best step from the `present` inputs, as their sensors show them."""
    base = measure([{}])
    here = tuple(float(v) for v in np.nan_to_num(base.apart[:, 0]))
    best = stay = Proposal(changes={}, here=here, apart=here)
    for _ in range(limits.MOST_INPUTS_OF_A_STEP):
        if best.separated == len(here):
            break
        further = [stay, *_further(allowed, present, best, measure, base)]
        found = max(further, key=lambda p: p.worth)
        if found.separated == best.separated:
            found = max(further, key=lambda p: sum(p.apart))
        more = found.separated - best.separated
        farther = sum(found.apart) >= sum(best.apart) + limits.CLEARLY_FARTHER
        if more < 0 or (more == 0 and not farther):
            break
        best = found
    return best


def _further(
    allowed: Allowed, present: Mapping[str, float], best: Proposal, measure: Measure, base: Looked
) -> Iterator[Proposal]:
    """Steps that move one input more than the best one so far, to each of its levels."""
    points = [
        {**best.changes, name: level}
        for name, own in allowed.inputs.items()
        if name not in best.changes
        for level in own.levels(limits.LEVELS_OF_A_STEP).tolist()
        if abs(level - present[name]) >= limits.SMALLEST_CHANGE * (own.highest - own.lowest)
    ]
    measured = measure(points) if points else base
    for i, point in enumerate(points):
        apart = measured.apart[:, i]
        if not np.isfinite(apart).any():
            continue
        ranges = {name: allowed.inputs[name] for name in point}
        flows = {m: (measured.flows[m][i], base.flows[m][0]) for m in sorted(allowed.costly)}
        # An unknown flow counts as changed.
        moved = [m for m, (v, now) in flows.items() if not abs(v - now) <= SAME_FLOW * abs(now)]
        yield Proposal(
            changes=point,
            here=best.here,
            apart=tuple(float(v) for v in np.nan_to_num(apart)),
            ramp=max(abs(v - present[n]) / ranges[n].rate for n, v in point.items()),
            hold=max(own.hold for own in ranges.values()),
            costs=(*(n for n, own in ranges.items() if own.costs), *moved),
        )


def step_in_words(
    ruleset: Ruleset,
    allowed: Allowed,
    present: Mapping[str, float],
    fault: str,
    others: Sequence[str],
    proposal: Proposal,
) -> str:
    """A step in a sentence; `present` are the inputs as their sensors show them."""
    if not proposal.changes:
        which = f"{fault} from {' or '.join(others)}"
        if not allowed.inputs:
            return f"no set point may be changed, so nothing separates {which}"
        most = f"at most {max(proposal.apart, default=0.0):.1f} sigma"
        return f"no change of set points within the permitted range separates {which} ({most})"
    parts, unclear = [], {}
    for other, here, there in zip(others, proposal.here, proposal.apart, strict=True):
        if there >= SEPARATED:
            parts.append(f"{fault} and {other} then differ by {there:.1f} sigma (now {here:.1f})")
        else:
            unclear[other] = there
    if unclear:
        most = f"at most {max(unclear.values()):.1f} sigma; it takes {SEPARATED:g} to be sure"
        parts.append(f"{fault} then hardly differs from {', '.join(unclear)} ({most})")
    step = set_points(ruleset, present, proposal)
    return f"{step}: {', '.join(parts)}{costs_in_words(proposal)}"


def set_points(ruleset: Ruleset, present: Mapping[str, float], proposal: Proposal) -> str:
    """What to set, how slowly, and for how long."""
    parts = []
    for name, value in proposal.changes.items():
        does = "raise" if value > present[name] else "lower"
        unit = ruleset.signal_by_id[name].unit
        # Four digits, but 15000 and not 1.5e+04.
        parts.append(f"{does} {name} from {float(f'{present[name]:.4g}'):g} to {value:g} {unit}")
    slowly = f", taking {proposal.ramp:.3g} s at least" if proposal.ramp else ""
    return f"{' and '.join(parts)}{slowly}, and hold it for {proposal.hold:g} s"


def costs_in_words(proposal: Proposal) -> str:
    """What costs product; empty if nothing does."""
    return f"; this costs product ({', '.join(proposal.costs)})" if proposal.costs else ""
