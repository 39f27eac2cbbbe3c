"""No proposal ever leaves the limits: random plants, points, limits and findings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec

from rulec.separation.allowed import Allowed, Range, allowed_of
from rulec.separation.limits import MOST_INPUTS_OF_A_STEP, STEP_SECONDS
from rulec.separation.propose import Looked, Measure, Point, Proposal, propose
from tests.conftest import compiled

PROPOSALS = 10_000
PLANTS = ("abc", "mixing-rig")
ROUNDING = 1e-9
"""Share of a value that is lost between units."""


def _measure(random: np.random.Generator, ruleset: Ruleset, rows: int) -> Measure:
    """Any distances and flows at all; some points are impossible."""

    def measure(points: Sequence[Point]) -> Looked:
        apart = random.exponential(random.choice([0.5, 3.0, 20.0]), (rows, len(points)))
        apart[:, random.random(len(points)) < 0.2] = np.nan
        flows = {m: 1.0 + 0.02 * random.standard_normal(len(points)) for m in ruleset.modules}
        return Looked(apart, flows)

    return measure


def _limits(random: np.random.Generator, ruleset: Ruleset) -> Allowed | None:
    """Limits of some inputs, some of them far outside of the plant's range; or none."""
    if random.random() < 0.2:
        return None
    inputs = {}
    for name in ruleset.simulation.given:
        if random.random() < 0.7:
            reference = ruleset.signal_by_id[name].shown(ruleset.signal_by_id[name].reference)
            lowest, highest = np.sort(reference * random.uniform(0.0, 2.0, 2))
            inputs[name] = Range(
                signal=ruleset.signal_by_id[name],
                lowest=float(lowest),
                highest=float(highest),
                rate=float(random.choice([math.inf, random.uniform(0.1, 100.0)])),
                hold=float(random.choice([0.0, random.uniform(1.0, 1000.0)])),
                costs=bool(random.random() < 0.3),
            )
    costly = [m for m in ruleset.modules if random.random() < 0.2]
    return Allowed(inputs, frozenset(costly))


def _ranged(random: np.random.Generator, ruleset: Ruleset) -> Ruleset:
    """A plant whose inputs have other ranges, calibrated or not."""
    signals = []
    for signal in ruleset.signals:
        made = signal
        if signal.is_input and random.random() < 0.5:
            low, high = np.sort(signal.reference * random.uniform(0.2, 1.8, 2)).tolist()
            made = replace(signal, valid_from=low, valid_to=high)
        if signal.is_input and random.random() < 0.3:
            low, high = np.sort(signal.reference * random.uniform(0.0, 2.0, 2)).tolist()
            made = replace(made, lowest=low, highest=high)
        signals.append(made)
    return replace(ruleset, signals=tuple(signals))


def _breaches(
    ruleset: Ruleset,
    given: Allowed | None,
    present: dict[str, float],
    proposal: Proposal,
) -> list[str]:
    """What a proposal does that it must not."""
    found = []
    for name, value in proposal.changes.items():
        signal = ruleset.signal_by_id[name]
        bounds = _bounds(signal, given)
        slack = ROUNDING * abs(value)
        found += [
            f"{name} {value}: {b}" for b in bounds if not b[0] - slack <= value <= b[1] + slack
        ]
        if given is None:
            continue
        if name not in given.inputs:
            found.append(f"{name} is not to be moved")
            continue
        limit = given.inputs[name]
        if abs(value - present[name]) > limit.rate * proposal.ramp * (1.0 + ROUNDING) and (
            math.isfinite(limit.rate)
        ):
            found.append(f"{name} moves too fast")
        if proposal.hold < limit.hold:
            found.append(f"{name} is held too briefly")
        if limit.costs and name not in proposal.costs:
            found.append(f"{name} costs product, and nothing says so")
    if proposal.changes and proposal.hold < STEP_SECONDS:
        found.append("held too briefly to be judged")
    if len(proposal.changes) > MOST_INPUTS_OF_A_STEP:
        found.append("too many changes at once")
    return found


def _bounds(signal: SignalSpec, given: Allowed | None) -> list[tuple[float, float]]:
    """Every range that a value as shown must lie in, worked out anew."""
    pairs = [(signal.lowest, signal.highest), (signal.valid_from, signal.valid_to)]
    ends = [(signal.shown(a), signal.shown(b)) for a, b in pairs if a is not None and b is not None]
    ends += [(signal.shown(signal.minimum), math.inf)] if signal.minimum is not None else []
    if given is not None and signal.id in given.inputs:
        ends.append((given.inputs[signal.id].lowest, given.inputs[signal.id].highest))
    return ends


def test_ten_thousand_proposals_keep_the_limits() -> None:
    """Also where the present point itself lies outside of them; most of them change something."""
    random = np.random.default_rng(27)
    plants = [compiled(name) for name in PLANTS]
    moved = costly = 0
    for number in range(PROPOSALS):
        if number % 20 == 0:
            ruleset = _ranged(random, plants[random.integers(len(plants))])
        given = _limits(random, ruleset)
        present = {
            name: ruleset.signal_by_id[name].shown(ruleset.signal_by_id[name].reference)
            * float(random.uniform(0.3, 1.7))
            for name in ruleset.simulation.given
        }
        rows = int(random.integers(1, 4))
        proposal = propose(allowed_of(ruleset, given), present, _measure(random, ruleset, rows))
        assert _breaches(ruleset, given, present, proposal) == []
        moved += bool(proposal.changes)
        costly += bool(proposal.costs)
    assert moved > PROPOSALS // 2
    assert costly > PROPOSALS // 20


@pytest.mark.parametrize(
    ("lowest", "highest"), [(540.0, 990.0), (0.123, 0.1377), (-3.3, 7.1), (1e6, 1.2e6), (5.0, 5.0)]
)
def test_levels_are_easily_set_and_inside(lowest: float, highest: float) -> None:
    signal = next(s for s in compiled("abc").signals if s.is_input)
    levels = Range(signal=signal, lowest=lowest, highest=highest).levels(5)
    assert len(levels) == (5 if highest > lowest else 0)
    assert all(lowest <= v <= highest and len(f"{v:.6g}") <= 8 for v in levels)


def test_step_that_costs_no_product_comes_first() -> None:
    """Where two steps tell the faults apart, the cheap one is taken though it is weaker."""
    ruleset = compiled("abc")
    signals = ruleset.signal_by_id
    limits = {
        name: Range(signal=signals[name], lowest=600, highest=1000, rate=10, costs=name == "A.n")
        for name in ("A.n", "B.n")
    }
    present = {"A.n": 900.0, "B.n": 900.0}

    def measure(points: Sequence[Point]) -> Looked:
        far = [20.0 if "A.n" in p else 5.0 if p else 1.0 for p in points]
        return Looked(np.array([far]), {})

    allowed = allowed_of(ruleset, Allowed(limits, frozenset()))
    proposal = propose(allowed, present, measure)
    assert list(proposal.changes) == ["B.n"]
    assert proposal.costs == ()
    assert proposal.apart == (5.0,)
    only = allowed_of(ruleset, Allowed({"A.n": limits["A.n"]}, frozenset()))
    assert propose(only, present, measure).costs == ("A.n",)
