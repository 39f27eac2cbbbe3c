"""From a finding with alternatives to the step that tells them apart, which keeps all limits."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.output.terminal import plain

from rulec.cli import main
from rulec.separation.allowed import Allowed, Range, allowed_of
from rulec.separation.limits import MOST_INPUTS_OF_A_STEP, STEP_SECONDS
from rulec.separation.propose import (
    Looked,
    Measure,
    Point,
    Proposal,
    propose,
    step_in_words,
)
from rulec.separation.table import Separated, show_separated
from tests.conftest import ROOT, Capsys, compiled
from tests.written import json_of, write_columns

PLANT = ROOT / "plants" / "abc"
LIMITS = """\
limits: abc
inputs:
  A.n: {lowest: 700, highest: 1000, unit: rpm, rate: 10, hold: 120, costs: product}
  B.n: {lowest: 13, highest: 16, unit: Hz, rate: 0.2}
modules:
  C: {costs: product}
"""


def _inputs(file: Path, points: list[tuple[float, float]]) -> Path:
    """A recording of set points, 60 s each."""
    a, b = np.repeat(points, 60, axis=0).T
    return write_columns(file, {"time [s]": np.arange(len(a)), "A.n [rpm]": a, "B.n [rpm]": b})


def _diagnosed(inputs: Path, fault: str, seed: int, *more: str) -> list[dict[str, Any]]:
    """The findings of a simulated recording, by a ruleset that is compiled already."""
    recording, ruleset = inputs.with_name("recording.csv"), inputs.with_name("abc.ruleset.json")
    if not ruleset.exists():
        ruleset.write_text(compiled("abc").to_json(), encoding="utf-8")
    noise = ["--fault", fault, "--noise", str(seed)]
    assert main(["simulate", str(ruleset), str(inputs), "-o", str(recording), *noise]) == 0
    return list(json_of("diagnose", ruleset, recording, *more)["findings"])


HERE = (900.0, 900.0)
SEEDS = range(1, 5)


@pytest.mark.parametrize("fault", ["A.clogging", "B.widening"])
def test_step_leads_from_two_causes_to_one(tmp_path: Path, fault: str) -> None:
    """Where one operating point leaves two causes, that one and the proposed one name one."""
    unclear = 0
    for seed in SEEDS:
        inputs = _inputs(tmp_path / "inputs.csv", [HERE, HERE])
        (found,) = _diagnosed(inputs, f"{fault}=0.1", seed)
        assert ("step" in found) == bool(found["alternatives"])
        if not found["alternatives"]:
            continue
        unclear += 1
        assert all(part["now"] < 4.0 < part["then"] for part in found["step"]["apart"])
        there = dict(zip(("A.n", "B.n"), HERE, strict=True))
        there |= {part["input"]: 60.0 * part["to"] for part in found["step"]["changes"]}
        inputs = _inputs(tmp_path / "inputs.csv", [HERE, (there["A.n"], there["B.n"])])
        (closed,) = _diagnosed(inputs, f"{fault}=0.1", seed)
        assert closed["fault"] == fault
        assert closed["alternatives"] == []
        assert "step" not in closed
    assert unclear >= len(SEEDS) // 2


def test_step_keeps_a_file_of_limits_and_says_what_it_costs(tmp_path: Path, capsys: Capsys) -> None:
    file = tmp_path / "limits.yaml"
    file.write_text(LIMITS, encoding="utf-8")
    inputs = _inputs(tmp_path / "inputs.csv", [HERE, HERE])
    found = [
        finding
        for seed in SEEDS
        for finding in _diagnosed(inputs, "A.clogging=0.15", seed, "--limits", str(file))
        if finding["alternatives"]
    ]
    assert found
    for finding in found:
        (change,) = finding["step"]["changes"]
        assert change["input"] == "B.n"
        assert 13.0 <= change["to"] <= 16.0
        assert finding["step"]["ramp"] == pytest.approx(abs(change["to"] - change["from"]) / 0.2)
        assert finding["step"]["costs_product"] == ["C"]
    output = " ".join(re.sub("[│├└─]", " ", capsys.readouterr().out).split())
    assert "to tell them apart: lower B.n from" in output
    assert "this costs product (C)" in output


def test_what_a_step_leaves_together_is_told_in_one_clause() -> None:
    ruleset = compiled("abc")
    allowed, present = allowed_of(ruleset, None), {"A.n": 900.0}
    step = Proposal(changes={"A.n": 700.0}, here=(0.5, 0.0, 0.0), apart=(6.2, 0.2, 1.5), hold=60)
    others = ["A.leakage", "A.dp.low", "A.P_el.low"]
    assert step_in_words(ruleset, allowed, present, "A.dp.high", others, step) == (
        "lower A.n from 900 to 700 rpm, and hold it for 60 s: "
        "A.dp.high and A.leakage then differ by 6.2 sigma (now 0.5), "
        "A.dp.high then hardly differs from A.dp.low, A.P_el.low "
        "(at most 1.5 sigma; it takes 4 to be sure)"
    )


def test_matrix_tells_the_step_of_each_pair(capsys: pytest.CaptureFixture[str]) -> None:
    """Of 16 pairs 10 are alike, and one step tells each of them apart."""
    pairs = json_of("matrix", PLANT, "--separate")["separate"]
    assert "one change of set points separates all of the other 10" in " ".join(
        capsys.readouterr().out.split()
    )
    assert len(pairs) == 16
    for pair in (p for p in pairs if not p["apart_already"]):
        assert pair["split"]
        assert [part["degree"] for part in pair["sigma"]] == [0.1, 0.2]
        assert np.all([part["then"] > max(4.0, part["now"]) for part in pair["sigma"]])
        assert all(change["unit"] == "rpm" for change in pair["changes"])


def test_nothing_is_left_to_separate_where_the_reference_point_does_it_all() -> None:
    far = Proposal(changes={}, here=(9.0, 9.0), apart=(9.0, 9.0))
    pair = Separated(("A.leakage", "A.clogging"), "alike", far)
    text = plain(lambda out: show_separated(out, compiled("abc"), [pair]))
    assert text.endswith("1 can be separated at the reference point (4 sigma)")


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
            lowest, highest = np.sort(reference * random.uniform(0.0, 2.0, 2)).tolist()
            rate = float(random.choice([math.inf, random.uniform(0.1, 100.0)]))
            hold = float(random.choice([0.0, random.uniform(1.0, 1000.0)]))
            costs = bool(random.random() < 0.3)
            own = {"lowest": lowest, "highest": highest, "rate": rate, "hold": hold, "costs": costs}
            inputs[name] = Range(signal=ruleset.signal_by_id[name], **own)
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


def _keeps(
    ruleset: Ruleset, given: Allowed | None, present: dict[str, float], proposal: Proposal
) -> None:
    """A proposal moves what it may, as far and as fast as it may, and says what that costs."""
    for name, value in proposal.changes.items():
        slack = ROUNDING * abs(value)
        for low, high in _bounds(ruleset.signal_by_id[name], given):
            assert low - slack <= value <= high + slack, name
        if given is None:
            continue
        limit = given.inputs[name]
        if math.isfinite(limit.rate):
            assert abs(value - present[name]) <= limit.rate * proposal.ramp * (1.0 + ROUNDING)
        assert proposal.hold >= limit.hold
        assert not limit.costs or name in proposal.costs
    assert not proposal.changes or proposal.hold >= STEP_SECONDS
    assert len(proposal.changes) <= MOST_INPUTS_OF_A_STEP


def _bounds(signal: SignalSpec, given: Allowed | None) -> list[tuple[float, float]]:
    """Every range that a value as shown must lie in, worked out anew."""
    pairs = [(signal.lowest, signal.highest), (signal.valid_from, signal.valid_to)]
    ends = [(signal.shown(a), signal.shown(b)) for a, b in pairs if a is not None and b is not None]
    ends += [(signal.shown(signal.minimum), math.inf)] if signal.minimum is not None else []
    if given is not None and signal.id in given.inputs:
        ends.append((given.inputs[signal.id].lowest, given.inputs[signal.id].highest))
    return ends


@pytest.mark.parametrize("count", [1_000, pytest.param(10_000, marks=pytest.mark.prove)])
def test_proposals_keep_the_limits(count: int) -> None:
    """Also where the present point itself lies outside of them; most of them change something."""
    random = np.random.default_rng(27)
    plants = [compiled(name) for name in PLANTS]
    moved = costly = 0
    for number in range(count):
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
        _keeps(ruleset, given, present, proposal)
        moved += bool(proposal.changes)
        costly += bool(proposal.costs)
    assert moved > count // 2
    assert costly > count // 20
