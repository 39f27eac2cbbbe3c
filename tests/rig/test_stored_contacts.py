"""Plants that store, known from their module types alone: what `diagnose` says at first contact."""

import pytest

from tests.conftest import compiled
from tests.rig.stored_contacts import FIRST, HOLE, LOSSES, SHIFT, Contact, covers, told

CASES = [Contact(FIRST), Contact(FIRST + 5)]
"""The shipped plant and a row of two or more tanks."""


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.layout.name)
def test_a_sound_plant_has_no_finding(case: Contact) -> None:
    """Laws that are off within their accuracy were told as wrong sensors and blocked outlets."""
    found = case.diagnosed()
    assert found.judged
    assert ((), ()) == (tuple(found.findings), tuple(found.unknown))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.layout.name)
def test_a_hole_is_told_at_its_tank(case: Contact) -> None:
    """It was told as a weak pump, as a level behind a settled tank is as low by either."""
    found = case.diagnosed(hole=True)
    assert told(found, tuple(f"{case.tank}.{loss}" for loss in LOSSES))
    assert all(covers(f, HOLE / (1.0 + HOLE)) for f in found.findings if f.fault.fault == "hole")


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.layout.name)
def test_a_zero_that_shifts_is_told_as_that(case: Contact) -> None:
    """It was not seen: before and behind the jump the balances fit alike."""
    (finding,) = case.diagnosed(shift=True).findings
    assert f"{case.sensor}.y.raised" == finding.fault.id
    assert covers(finding, SHIFT)


def test_laws_of_balances_are_as_accurate_as_their_authors_say() -> None:
    """A standard uncertainty is half of the accuracy, 4 % of outlets and 5 % of the pump."""
    dynamics = compiled("cascaded-tanks").dynamics
    assert dynamics is not None
    assert {"pump.pump": 0.025, "upper.outflow": 0.02, "lower.outflow": 0.02} == dynamics.forms
