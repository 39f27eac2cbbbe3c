"""`rulec study`: the same figures on any number of processes, and counts that add up."""

import json
import os
import signal
import subprocess
import sys
from math import comb
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rulec
from rulec.passes.perturb import perturbed, true_plan
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from rulec.simulation.equations import equations_of
from rulec.study.campaign import Group, Kind, Outcome, _laws_off
from rulec.study.points import operating_points, range_of
from rulec.study.summary import percent, reliable_from, rows_of, sentences
from rulec.study.tally import Tally, tally, upper_bound
from tests.conftest import ROOT, compiled
from tests.written import json_of

ABC = ROOT / "plants" / "abc"
TYPES = {"A": "dosing-pcp", "B": "dosing-pcp", "C": "static-mixer"}


@pytest.fixture(scope="module")
def tiny() -> dict[str, Any]:
    """A study of one recording per fault, in this process."""
    asked = ("--degrees", "0.3", "--points", "1", "--seeds", "1", "--jobs", "1")
    return dict(json_of("study", ABC, *asked))


def test_counts_add_up(tiny: dict[str, Any]) -> None:
    """Every recording is in exactly one kind; found, confusions and healthy ones follow. At 30 %
    every hydraulic fault and pressure sensor is seen, and nothing in healthy plants."""
    modules = {name: list(TYPES.values()).count(name) for name in TYPES.values()}
    for cell in tiny["faults"]:
        kinds = cell["kinds"]
        assert modules[cell["type"]] == sum(kinds.values())
        assert cell["recordings"] == sum(kinds.values()) - kinds["no operating point"]
        named_at_all = kinds["named first"] + kinds["another named first"]
        assert cell["found"] == named_at_all + kinds["nothing known fits"]
        assert cell["covered"] <= cell["named"] == kinds["named first"]
        assert cell["shared"] <= kinds["another named first"]
    others = sum(cell["kinds"]["another named first"] for cell in tiny["faults"])
    assert others == sum(confusion["count"] for confusion in tiny["confusions"])
    seen = {(c["type"], c["name"]) for c in tiny["faults"] if c["found"] == c["recordings"]}
    assert {(t, f) for t in modules for f in ("clogging", "widening", "dp.high")} <= seen
    healthy = tiny["healthy"]
    assert (20, 400, 0) == (healthy["recordings"], healthy["samples"], healthy["alarms"])


def test_operating_points_are_inside_their_ranges() -> None:
    """The reference point first, then points within the calibrated range of each input."""
    for plant in ("abc", "zema-hydraulic"):
        equations = equations_of(compiled(plant))
        points = operating_points(equations, 5)
        assert len(points) == 5
        for spec in equations.given_signals:
            low, high = range_of(spec)
            values = points.given[spec.id]
            assert values[0] == np.clip(spec.reference, low, high)
            assert np.all((low <= values) & (values <= high))
            assert len(set(values)) == 5


def fixed(value: float) -> Any:
    """In place of random numbers: always the same."""
    drawn = lambda size=None: value if size is None else np.full(size, value)  # noqa: E731
    return SimpleNamespace(standard_normal=drawn)


def test_parameters_are_drawn_from_their_covariance() -> None:
    """One standard deviation each: alone u, in a block the row of the Cholesky factor. Without
    deviation the true plant has the undo plan of the ruleset."""
    models = run_passes(Compilation(path=ABC), "types")
    faults = [f.id for f in compiled("abc").faults]
    assert compiled("abc").undo == true_plan(models, faults, fixed(0.0))
    models = run_passes(Compilation(path=ROOT / "plants" / "zema-hydraulic"), "types")
    drawn = perturbed(models, fixed(1.0)).plant.modules
    for name, module in models.network.plant.modules.items():
        expected = {p.name: p.value + p.u for p in module.parameters.values()}
        for block in module.blocks:
            for parameter, row in zip(block.parameters, block.factor, strict=True):
                expected[parameter] = module.parameters[parameter].value + sum(row)
        values = {p.name: p.value for p in drawn[name].parameters.values()}
        assert expected == pytest.approx(values, rel=1e-12)


def test_upper_bound_of_a_rate() -> None:
    """A rate of that size would show so few in 5 % of all runs (Clopper, Pearson 1934)."""
    for count, of in ((0, 60), (1, 60), (7, 200), (19, 400)):
        bound = upper_bound(count, of)
        chances = (comb(of, k) * bound**k * (1.0 - bound) ** (of - k) for k in range(count + 1))
        assert sum(chances) == pytest.approx(0.05)
    assert upper_bound(5, 5) == 1.0
    assert upper_bound(0, 0) == 1.0


def counted() -> Tally:
    """Outcomes by hand: leakage named at 20 %, confused at 10 %; power never seen."""
    rows = (
        ("A.leakage", 0.2, Kind.NAMED, "A.leakage", False, 0.21, 0.19, 0.23),
        ("B.leakage", 0.2, Kind.NAMED, "B.leakage", False, 0.17, 0.16, 0.18),
        ("A.leakage", 0.1, Kind.OTHER, "A.widening", True, 0.1, 0.1, 0.1),
        ("B.leakage", 0.1, Kind.OTHER, "C.widening", False, 0.1, 0.1, 0.1),
    )
    names = ("fault", "degree", "kind", "first", "shared", "estimate", "lower", "upper")
    leak = [Outcome(**dict(zip(names, row, strict=True))) for row in rows]  # type: ignore[arg-type]
    others = (
        ("A.P_el.low", 0.2, Kind.QUIET),
        ("B.P_el.low", 0.2, Kind.NO_POINT),
        ("C.clogging", 0.2, Kind.UNKNOWN),
        ("C.clogging", 0.3, Kind.NO_POINT),
        ("", 0.0, Kind.QUIET),
        ("", 0.0, Kind.UNKNOWN),
    )
    leak += [Outcome(fault=fault, degree=degree, kind=kind) for fault, degree, kind in others]
    return tally(compiled("abc"), TYPES, leak, samples=20, lead_in=0)


def test_summary_says_what_the_counts_mean() -> None:
    """Two modules of a type are one row; reliable, without a name, confused, blind, left out are
    each a sentence; a degree that is found below one that is not is luck; the largest degree may
    have no operating point."""
    leak = next(c for c in counted().cells if c.fault.name == "leakage" and c.degree == 0.2)
    assert (leak.recordings, leak.found, leak.named, leak.covered) == (2, 2, 2, 1)
    assert (leak.error, leak.bias) == pytest.approx((0.02, -0.01))
    text = "\n".join(sentences(counted()))
    for part in (
        "Detected and identified (first or as an alternative) from 20 % on: Internal leakage of ",
        "Cannot be seen: P_el reads low of dosing-pcp.",
        "Internal leakage of dosing-pcp is taken for Widening of dosing-pcp in 1 of 4",
        "Internal leakage of dosing-pcp is taken for Widening of static-mixer in 1 of 4",
        "off by 0.020 on average (bias -0.010); its bounds hold the true one in 1 of 2",
        "False alarms: 1 of 2 healthy recordings (40 samples)",
        "Detected, but not always identified: Clogging of static-mixer.",
        "Left out: 2 recordings",
    ):
        assert part in text
    rows = {kind.name: cells for kind, cells in rows_of(counted()).items()}
    found = (rows["leakage"], rows["leakage"][:1], rows["clogging"])
    assert [0.2, None, None] == [reliable_from(cells) for cells in found]
    assert ["1.7 %", "99 %", "100 %"] == [percent(share) for share in (0.017, 0.994, 1.0)]


def test_the_function_gives_what_the_command_writes(tiny: dict[str, Any]) -> None:
    """On any number of processes; and tables of it. A number that makes no sense is refused with
    the words of the command."""
    lines: list[str] = []
    done: list[Any] = []
    asked: dict[str, Any] = {"degrees": [0.3], "points": 1, "seeds": 1, "announce": lines.append}
    found = rulec.study(ABC, jobs=2, progress=lambda *one: done.append(one), **asked)
    assert tiny == json.loads(json.dumps(found.to_dict()))
    assert lines[0].startswith("abc: ")
    assert done[-1][1] == done[-1][2]
    assert len(found.to_frame(backend="pandas")) == len(tiny["faults"])
    assert "False alarms: 0 of 20 healthy recordings" in str(found)
    assert "what its diagnosis can do" in " ".join(found.page().lower().split())
    with pytest.raises(rulec.Misused, match="--seeds 0: give 1 or more"):
        rulec.study(ABC, seeds=0)


@pytest.mark.skipif(os.name == "nt", reason="signals of process groups are a POSIX matter")
def test_interrupt_ends_cleanly() -> None:
    """Ctrl-C reaches all processes; one line, no traceback, nothing left running."""
    command = [sys.executable, "-m", "rulec", "study", str(ABC), "--seeds", "50", "--jobs", "2"]
    with subprocess.Popen(
        command,
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # Interrupts are heard, also where these tests hear none.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        assert process.stderr is not None
        announced = process.stderr.readline()
        os.killpg(process.pid, signal.SIGINT)
        said = process.stderr.read()
        assert process.wait(timeout=30) == 130
    assert announced.startswith("abc: 8100 faulty and 3000 healthy recordings")
    assert said.rstrip().endswith("rulec: interrupted")
    assert "Traceback" not in said


def test_laws_that_nobody_calibrated_are_off_within_their_accuracy() -> None:
    """By some per cent of the flow; those of plant abc, calibrated without a misfit, hold."""
    for plant, least, most in (("abc", 0.0, 0.0), ("irrigation-booster", 0.001, 0.3)):
        equations = equations_of(compiled(plant))
        points = operating_points(equations, 2)
        group = Group("", 7, 0, equations.ruleset.undo)
        off = dict(_laws_off(equations, points, group))
        flows = {o.id: o.reference for o in equations.ruleset.observers}
        shares = [np.max(np.abs(own / flows[name])) for name, own in off.items()]
        assert least <= max(shares) <= most
