"""The example as shipped, and its plant with a column map."""

import shutil
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording

from tests.conftest import ROOT

ABC = ROOT / "plants" / "abc"


@pytest.fixture(scope="module")
def expected(abc: Ruleset) -> Recording:
    return read_recording(ABC / "examples" / "healthy.csv", abc)


@pytest.fixture(scope="module")
def column_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the plant beside it looks for its column map."""
    plant = tmp_path_factory.mktemp("plant")
    shutil.copytree(ABC, plant, dirs_exist_ok=True)
    with (plant / "plant.yaml").open("a", encoding="utf-8") as text:
        text.write("\ncolumns: columns.yaml\n")
    return plant / "columns.yaml"
