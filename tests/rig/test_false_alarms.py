"""What was told wrongly of a real recording once is not told as certain again."""

from pathlib import Path

import pytest

from rulec.prove.limits import CERTAIN, PATIENCE
from rulec.prove.real.make import made
from rulec.prove.real.rig_folder import FalseAlarm, false_alarms_in, read_rig
from rulec.prove.real.run_tool import ask, lay_out
from rulec.prove.real.score import alarms, scored
from tests.rig import real

RECIPES = Path(__file__).parent / "recipes"


@pytest.fixture(scope="session")
def rigs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All rigs whose recordings are at hand."""
    target = tmp_path_factory.mktemp("rigs")
    list(made(RECIPES, real(), target))
    return target


@pytest.mark.prove
@pytest.mark.parametrize("alarm", false_alarms_in(RECIPES), ids=lambda a: f"{a.rig} {a.wrong}")
def test_no_false_alarm_is_certain_again(alarm: FalseAlarm, rigs: Path, tmp_path: Path) -> None:
    if not (rigs / alarm.rig).is_dir():
        pytest.skip(f"the recordings of {alarm.rig} are not at hand")
    rig = read_rig(rigs / alarm.rig)
    lay_out(rig, tmp_path / "work")
    asked = ask(tmp_path / "work", None, PATIENCE)
    assert asked["form"] is not None, asked["error"]
    (again,) = alarms([alarm], [scored(rig, asked)])
    assert (again.again or 0.0) < CERTAIN, alarm.story
