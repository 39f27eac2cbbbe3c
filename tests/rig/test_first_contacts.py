"""Plants known from a data sheet alone: what `diagnose` says of them at first contact."""

from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import FORM
from rulec_runtime.diagnosis.steady.observe import slope_names

from rulec.passes.limits import FORM_COMMON
from rulec.passes.pipeline import compile_plant, example
from rulec.prove.truth.contacts import Planned, planned
from tests.conftest import compiled
from tests.rig.first_contacts import (
    FIRST,
    blames_a_meter,
    calibrated,
    causes,
    diagnosed,
    with_a_wrong_meter,
)

SOUND = [case for case in planned(FIRST, 10) if not case.other]
OTHER = [case for case in planned(FIRST, 10) if case.other]


@pytest.mark.parametrize("case", SOUND, ids=lambda case: case.kind)
def test_a_healthy_plant_within_its_sheet_has_no_finding(case: Planned) -> None:
    found = diagnosed(case)
    assert found.judged
    assert ((), (), ()) == (tuple(found.findings), tuple(found.unknown), tuple(found.sensors))


def test_no_meter_is_blamed_for_a_law_of_another_form() -> None:
    """But for one of these; the ledger has the share."""
    assert 1 >= sum(blames_a_meter(diagnosed(case)) for case in OTHER)


def test_a_meter_that_is_wrong_from_the_middle_on_is_among_the_causes() -> None:
    """In most of these; the ledger has the share. No flow meter at several times the flow where
    the power meter is off."""
    found = list(with_a_wrong_meter(iter(SOUND)))
    assert len(SOUND) < 2 * sum(f"{meter}.high" in causes(told) for meter, told in found)
    assert all(f.degree < 1.0 for _, told in found for f in told.findings)


def test_a_calibration_with_few_points_raises_no_alarm() -> None:
    """Its scatter may be small by chance, and no law obeys its formula exactly."""
    behind = [told for case in SOUND if (told := calibrated(case))]
    assert len(SOUND) - 1 <= len(behind)
    assert all(told.judged and not told.findings for told in behind)


def test_a_course_that_has_faded_is_no_fault_that_is_there() -> None:
    """A flow meter was told as too high by -0.9 %, 0 to 1.4 %."""
    (case,) = planned(1048, 1)
    told = diagnosed(case)
    assert told.judged
    assert all(f.degree > 0.0 and f.lower < f.degree < f.upper for f in told.findings)


def test_a_law_that_nobody_calibrated_is_as_accurate_as_its_author_says() -> None:
    """4 % of the flow at 95 % for the line of a dosing module, in two parts; none once a
    calibration states its misfit."""
    line = example("types").types["dosing-pcp"].forms["plant"]
    flow = example("types").types["dosing-pcp"].observers["plant"]
    assert 0.02 == pytest.approx(float(line["plant"] / flow))
    errors = {name.split(":", 2)[2] for name in slope_names(compiled("hsy-pumping"))}
    assert {"P14.Q_H.form", "P14.Q_H.form~"} == {e for e in errors if e.startswith("P14.Q_H")}
    assert not [name for name in slope_names(compiled("abc")) if FORM in name]


def test_a_law_and_an_observer_may_have_one_name(tmp_path: Path) -> None:
    """The accuracy of `head` is a share of the head, not of the flow that is observed by it."""
    for case in (c for c in SOUND if c.kind == "pump-curve-exponent"):
        case.make().write(tmp_path)
    (file,) = (tmp_path / "plant" / "kb" / "modules").glob("*.yaml")
    text = file.read_text(encoding="utf-8")
    assert "{is: dp, title" in text
    text = text.replace("head:   {is: dp, title", 'head:   {is: dp, accuracy: "10 %, test", title')
    file.write_text(text, encoding="utf-8")
    ruleset = compile_plant(tmp_path / "plant")
    inputs = {s.id: s.reference for s in ruleset.signals}
    out = ruleset.plan.run(
        {**inputs, **{f"u:{n}": 0.0 for n in inputs}, "u:parameters": 1.0, "u:model": 1.0}
    )
    share = float(out["s:unit.head:unit.head.form"][0] / out["q:unit.head"][0])
    assert 0.05 * FORM_COMMON**0.5 == pytest.approx(share)
