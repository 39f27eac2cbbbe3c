"""A step in words: what to set, for how long, what is known then, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rulec_runtime.contract.ruleset import Ruleset

from rulec.limits import SEPARATED
from rulec.separation.allowed import Allowed
from rulec.separation.propose import Proposal


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
    parts = []
    for other, here, there in zip(others, proposal.here, proposal.apart, strict=True):
        enough = "" if there >= SEPARATED else f"; it takes {SEPARATED:g} to be sure"
        parts.append(
            f"{fault} and {other} then differ by {there:.1f} sigma (now {here:.1f}{enough})"
        )
    step = set_points(ruleset, present, proposal)
    return f"{step}: {', '.join(parts)}{costs_in_words(proposal)}"


def set_points(ruleset: Ruleset, present: Mapping[str, float], proposal: Proposal) -> str:
    """What to set, how slowly, and for how long."""
    parts = []
    for name, value in proposal.changes.items():
        does = "raise" if value > present[name] else "lower"
        unit = ruleset.signal_by_id[name].unit
        parts.append(f"{does} {name} from {present[name]:.4g} to {value:g} {unit}")
    slowly = f", taking {proposal.ramp:.3g} s at least" if proposal.ramp else ""
    return f"{' and '.join(parts)}{slowly}, and hold it for {proposal.hold:g} s"


def costs_in_words(proposal: Proposal) -> str:
    """What costs product; empty if nothing does."""
    return f"; this costs product ({', '.join(proposal.costs)})" if proposal.costs else ""
