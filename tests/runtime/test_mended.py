"""After a mistake in the table is found the rest is judged: what is in the mended readings is told.

Recordings of plant abc come from the independent simulator; a leakage begins at a third of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form
from rulec_runtime.report.wording import kept_of

from rulec.prove.truth import INSIDE, Run, operating_points, record, visiting_run
from tests.method.readings import built, recording, ruleset

LEAKAGE, DEGREE = "A.leakage", 0.4
PSI = 14.5038
"""Pounds per square inch in a bar."""


@cache
def leaking(points: int = 6, hold: int = 40) -> Recording:
    """Some operating points; the leakage begins behind a third of the samples."""
    plant = built("abc")
    run = visiting_run(plant, operating_points(plant, points), {}, 0, hold)
    n = run.operation.time.size
    degree = np.where(np.arange(n) < n // 3, 0.0, DEGREE)
    made = record(Run(plant, run.operation, {LEAKAGE: degree}), INSIDE, 1)
    return recording(ruleset("abc"), made.readings)


def exchanged(made: Recording) -> Recording:
    values = made.values
    return replace(made, values={**values, "A.dp": values["B.dp"], "B.dp": values["A.dp"]})


def times(factor: float, names: tuple[str, ...]) -> Callable[[Recording], Recording]:
    def bent(made: Recording) -> Recording:
        return replace(
            made, values={n: v * factor if n in names else v for n, v in made.values.items()}
        )

    return bent


ALL = ("A.dp", "B.dp", "C.dp")
CASES: dict[str, tuple[Callable[[Recording], Recording], tuple[str, ...], str]] = {
    "two columns swapped": (exchanged, ("A.dp", "B.dp"), "A.dp and B.dp exchanged"),
    "one pressure in psi": (times(PSI, ("A.dp",)), ("A.dp",), "A.dp in psi"),
    "all pressures in kPa": (times(100.0, ALL), ALL, "A.dp, B.dp, C.dp in kPa"),
}


def leakage_of(found: Diagnosis) -> None:
    """One finding, the leakage with the degree that was set."""
    (finding,) = found.findings
    assert finding.fault.id == LEAKAGE
    assert finding.degree == pytest.approx(DEGREE, abs=0.02)
    assert not found.unknown


@pytest.mark.parametrize("case", CASES)
def test_what_is_in_the_mended_reading_is_told(case: str) -> None:
    bent, signals, mended = CASES[case]
    found = diagnose(bent(leaking()), ruleset("abc"))
    assert signals == tuple(s.signal for s in found.sensors)
    assert {f"judged with this corrected: {mended}"} == {kept_of(s) for s in found.sensors}
    assert found.status == "C"
    leakage_of(found)
    form = diagnosis_form(found)["findings"]
    assert [mended] * len(signals) == [f["mended"] for f in form if f["kind"] == "sensor"]


def test_a_sound_plant_with_all_pressures_in_another_unit() -> None:
    made = leaking()
    values = {n: v[:80] for n, v in made.values.items()}
    sound = replace(made, time=made.time[:80], values=values, segment=made.segment[:80])
    found = diagnose(times(100.0, ALL)(sound), ruleset("abc"))
    assert ALL == tuple(s.signal for s in found.sensors)
    assert ((), ()) == (found.findings, found.unknown)


@pytest.mark.parametrize(("points", "kind"), [(1, "stuck"), (6, "stuck"), (6, "range")], ids=str)
def test_a_leakage_beside_a_dead_pressure_of_its_module(points: int, kind: str) -> None:
    """All estimates of the module read the pressure, which is frozen or, from the first sample on,
    at the end of its range; any pressure leaves the leakage over."""
    made, signal = leaking(points, 240 // points), ruleset("abc").signal_by_id["A.dp"]
    assert signal.highest is not None
    shown = made.values["A.dp"].copy()
    shown[30:] = shown[30]
    if kind == "range":
        shown[:] = 1.08 * signal.highest
    found = diagnose(replace(made, values={**made.values, "A.dp": shown}), ruleset("abc"))
    assert [f"A.dp.{kind}"] == [s.id for s in found.sensors]
    leakage_of(found)
    if kind == "stuck":
        (blind,) = found.not_judged
        assert "in part: A.dp: stuck at one value; cannot detect A.dp.high, A.dp.low" == blind.text
