"""`rulec study`: the same figures on any number of processes, and counts that add up."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rulec
from rulec.cli import main
from rulec.passes.perturb import perturbed, true_plan
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from rulec.simulation.equations import equations_of
from rulec.study.campaign import Kind, Outcome
from rulec.study.points import operating_points, range_of
from rulec.study.summary import percent, reliable_from, rows_of, sentences
from rulec.study.tally import Tally, tally, upper_bound
from tests.conftest import ROOT, compiled

ABC = ROOT / "plants" / "abc"
TYPES = {"A": "dosing-pcp", "B": "dosing-pcp", "C": "static-mixer"}
TINY = ("--degrees", "0.3", "--points", "1", "--seeds", "1")


def study(file: Path, *arguments: str, plant: Path = ABC) -> dict[str, Any]:
    """JSON of a study of a plant."""
    assert main(["study", str(plant), *arguments, "--json", str(file)]) == 0
    result: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return result


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A study of one recording per fault, in this process."""
    return study(tmp_path_factory.mktemp("study") / "tiny.json", *TINY, "--jobs", "1")


def test_counts_add_up_on_any_number_of_processes(tiny: dict[str, Any], tmp_path: Path) -> None:
    """One process or two: the same counts, errors and words. Every recording is in exactly one
    kind; found, confusions and healthy ones follow. At 30 % every hydraulic fault and pressure
    sensor is seen, and nothing in healthy plants."""
    assert tiny == study(tmp_path / "two.json", *TINY, "--jobs", "2")
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


class Fixed:
    """In place of random numbers: always the same."""

    def __init__(self, value: float) -> None:
        self.value = value

    def standard_normal(self, size: int | None = None) -> Any:
        return self.value if size is None else np.full(size, self.value)


def test_parameters_are_drawn_from_their_covariance() -> None:
    """One standard deviation each: alone u, in a block the row of the Cholesky factor. Without
    deviation the true plant has the undo plan of the ruleset."""
    models = run_passes(Compilation(path=ABC), "types")
    faults = [f.id for f in compiled("abc").faults]
    assert compiled("abc").undo == true_plan(models, faults, Fixed(0.0))  # type: ignore[arg-type]
    models = run_passes(Compilation(path=ROOT / "plants" / "zema-hydraulic"), "types")
    drawn = perturbed(models, Fixed(1.0)).plant.modules  # type: ignore[arg-type]
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
    blind = [
        Outcome(fault="A.P_el.low", degree=0.2, kind=Kind.QUIET),
        Outcome(fault="B.P_el.low", degree=0.2, kind=Kind.NO_POINT),
    ]
    unknown = [Outcome(fault="C.clogging", degree=0.2, kind=Kind.UNKNOWN)]
    healthy = [
        Outcome(fault="", degree=0.0, kind=Kind.QUIET),
        Outcome(fault="", degree=0.0, kind=Kind.UNKNOWN),
    ]
    outcomes = [*leak, *blind, *unknown, *healthy]
    return tally(compiled("abc"), TYPES, outcomes, samples=20, lead_in=0)


def test_summary_says_what_the_counts_mean() -> None:
    """Two modules of a type are one row; reliable, without a name, confused, blind, left out are
    each a sentence; a degree that is found below one that is not is luck."""
    leak = next(c for c in counted().cells if c.fault.name == "leakage" and c.degree == 0.2)
    assert (leak.recordings, leak.found, leak.named, leak.covered) == (2, 2, 2, 1)
    assert (leak.error, leak.bias) == pytest.approx((0.02, -0.01))
    text = "\n".join(sentences(counted()))
    for part in (
        "Detected and identified (first or as an alternative) from 20 % on: Internal leakage of ",
        "Cannot be seen: P_el reads low of dosing-pcp.",
        "Detected but not identified: Clogging of static-mixer in 1 of 1 recordings",
        "Internal leakage of dosing-pcp is taken for Widening of the same module in 1 of 4",
        "Internal leakage of dosing-pcp is taken for Widening of another module (static-mixer)",
        "off by 0.020 on average (bias -0.010); its bounds hold the true one in 1 of 2",
        "False alarms: 1 of 2 healthy recordings (40 samples)",
        "Left out: 1 recordings",
    ):
        assert part in text
    rows = {kind.name: cells for kind, cells in rows_of(counted()).items()}
    found = (rows["leakage"], rows["leakage"][:1], rows["clogging"])
    assert [0.2, None, None] == [reliable_from(cells) for cells in found]
    assert ["1.7 %", "99 %", "100 %"] == [percent(share) for share in (0.017, 0.994, 1.0)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--degrees", "ten"), "--degrees ten: give numbers with commas between"),
        (("--degrees", "nan"), "--degrees nan: a degree is a number above 0"),
        (("--degrees", "50"), "--degrees 50: no fault of abc has such a degree"),
        (("--json", "nowhere/file.json"), "--json nowhere/file.json: there is no folder"),
        (("--points", "0"), "--points 0: give 1 or more"),
        (("--lead-in", "-5"), "--lead-in -5: give 0 or more"),
    ],
)
def test_bad_arguments(
    arguments: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong argument is named with its remedy; exit code 2. A ruleset has no covariances."""
    assert main(["study", str(ABC), *arguments]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert main(["study", "abc.ruleset.json"]) == 2
    assert "abc.ruleset.json: give the plant's folder" in capsys.readouterr().err


def test_the_function_gives_what_the_command_writes(tiny: dict[str, Any]) -> None:
    """And tables of it; a number that makes no sense is refused with the words of the command."""
    told: list[str] = []
    done: list[Any] = []
    asked: dict[str, Any] = {"degrees": [0.3], "points": 1, "seeds": 1, "announce": told.append}
    found = rulec.study(ABC, progress=lambda *one: done.append(one), **asked)
    assert tiny == json.loads(json.dumps(found.to_dict()))
    assert told[0].startswith("abc: ")
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
