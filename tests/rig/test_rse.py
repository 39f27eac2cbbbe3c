"""The boiler branch from its data sheets: the valve is named, the pump keeps to its sheet."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import recordings_folder
from tests.rig.mismatch.ask import Answer, adopt
from tests.rig.rse import (
    FOLDER,
    LONGER,
    PUMP,
    RESISTANCES,
    SHORTER,
    asked,
    day_file,
    distances,
    error_on,
    strained,
    values,
    valve_probability,
)

pytestmark = pytest.mark.prove


@pytest.fixture(scope="module")
def folder() -> Path:
    """Folder of the two days."""
    found = recordings_folder() / FOLDER
    if not found.is_dir():
        pytest.skip(f"no real recordings at {found} (set RULEC_RECORDINGS)")
    return found


@pytest.fixture(scope="module")
def answers(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Answer]:
    """What the tool says of each day, from the sheets."""
    work = tmp_path_factory.mktemp("rse")
    return {day: asked(folder, day, work) for day in (SHORTER, LONGER)}


@pytest.fixture(scope="module")
def adopted(answers: dict[str, Answer]) -> Path:
    """The plant adopted from the longer day."""
    return adopt(answers[LONGER])


@pytest.mark.parametrize("day", [SHORTER, LONGER])
def test_valve_is_named(answers: dict[str, Answer], day: str) -> None:
    """A valve of equal percentage, written down as linear, is named with its class."""
    assert valve_probability(answers[day]) >= 0.9


@pytest.mark.parametrize("day", [SHORTER, LONGER])
def test_pump_is_not_strained(answers: dict[str, Answer], day: str) -> None:
    """The pump has a sheet, and nothing is wrong with it."""
    assert all(strained(answers[day]).get(name, 0.0) <= 2.0 for name in PUMP)


def test_adopted_plant_is_believable(adopted: Path) -> None:
    """Pump within 2 u of its sheet, resistances positive."""
    assert all(off <= 2.0 for off in distances(adopted).values())
    assert all(values(adopted)[name]["value"] > 0.0 for name in RESISTANCES)


@pytest.mark.xfail(strict=True, reason="0.24 m3/h: a known gap, see README")
def test_adopted_plant_predicts_another_day(folder: Path, adopted: Path, tmp_path: Path) -> None:
    """The recalibrated linear law is off by 0.29 m3/h there, a grey box by 0.16."""
    assert error_on(adopted, day_file(folder, SHORTER), tmp_path / "simulated.csv") <= 0.20
