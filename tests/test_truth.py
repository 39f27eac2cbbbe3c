"""The truth of dosing plants: the shipped recordings, byte by byte, hold its physics; it is
independent of what it tests."""

import ast
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from rulec.prove.truth.sensors import Sensing, read
from rulec.prove.truth.units import RPM
from tests.conftest import ROOT
from tests.dosing import RIGS, Operation, Run, healthy_run, record
from tests.dosing.__main__ import main

TRUTH = ROOT / "rulec" / "prove" / "truth"
ABC = RIGS["abc"]
FIXED = Sensing(statistical=0.0)


@pytest.mark.parametrize(
    ("law", "spread", "largest"),
    [("normal", 1.0, np.inf), ("truncated", 0.880, 2.0)],
)
def test_laws_of_systematic_errors(law: str, spread: float, largest: float) -> None:
    """Spread in units of half the bound; drawn inside the bounds, none is beyond them. A sensor
    that reads higher than with another seed does so under every law."""

    def drawn(sensing: Sensing, seeds: int) -> list[float]:
        sensors, value = {n: ABC.rig.sensors[n] for n in ("A.P_el", "B.P_el")}, np.array([149.0])
        every = product(range(seeds), sensors.items())
        return [float((read(s, n, value, sensing, k) - s.shown(value))[0]) for k, (n, s) in every]

    found = drawn(replace(FIXED, law=law), 400)
    assert 5.0 * spread == pytest.approx(np.std(found), rel=0.05)
    assert np.abs(found).max() <= 5.0 * largest
    assert np.argsort(found[:20]).tolist() == np.argsort(drawn(FIXED, 10)).tolist()


def test_impossible_requests_are_refused() -> None:
    """A weak pump, an unknown fault, a degree out of range, a reading that is no number."""
    plant = RIGS["abc-centrifugal"]
    slow = {"A": np.full(3, 300 * RPM), "B": np.full(3, 900 * RPM)}
    with pytest.raises(ValueError, match="no operating point"):
        record(Run(plant, Operation(np.arange(3.0), slow)))
    for fault, why in (("C.leakage", "no fault 'C.leakage'"), ("A.widening", "needs 3 degrees")):
        with pytest.raises(ValueError, match=why):
            record(Run(ABC, healthy_run(ABC, 3).operation, {fault: np.ones(3)}))
    with pytest.raises(ValueError, match="no operating point"):
        record(Run(plant, Operation(np.arange(3.0), slow | {"A": np.full(3, np.nan)})))


MADE_OTHERWISE = {"abc": ("leakage_A.parquet", "step_B.csv")}
"""Recordings in another format, or made by another command."""


@pytest.mark.parametrize("name", ["abc", "mixing-rig"])
def test_shipped_examples_are_those_the_command_makes(name: str, tmp_path: Path) -> None:
    """`examples` reproduces the files of a plant's examples, byte for byte, but for those named."""
    main(["examples", "--plant", name, "-o", str(tmp_path)])
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    files = (path for path in (ROOT / "plants" / name / "examples").iterdir() if path.is_file())
    shipped = {path.name: path.read_bytes() for path in files}
    assert set(MADE_OTHERWISE.get(name, ())) == shipped.keys() - made.keys()
    assert made == {n: content for n, content in shipped.items() if n in made}
    assert 100_000 > max(len(content) for content in made.values())


def test_shares_no_code_with_what_it_tests() -> None:
    """No source of the simulator imports the tool; of tanks YAML is the tables of laws
    and effects alone."""
    for path in (*TRUTH.rglob("*.py"), *(ROOT / "tests" / "dosing").glob("*.py")):
        is_plain = path.parent.name == "tanks" and path.stem not in ("effect", "plant")
        foreign = {"rulec", "rulec_runtime", *(("yaml",) if is_plain else ())}
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names = [name for name in names if not name.startswith("rulec.prove.truth.")]
            assert not {name.partition(".")[0] for name in names} & foreign, path
