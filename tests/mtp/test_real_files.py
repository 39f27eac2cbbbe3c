"""Files of real makers, which are not part of the project; a plain walk counts what is there."""

from pathlib import Path

import pytest

from tests.rig.mtp import compared, files, folder, plain_seconds, seconds

pytestmark = pytest.mark.skipif(not files(), reason=f"no real packages in {folder()}")


@pytest.mark.parametrize("file", files(), ids=lambda f: f.name)
def test_all_tags_units_and_nodes_are_found(file: Path) -> None:
    """Units by the file, or else by the controller; tags and nodes all."""
    row = compared(file)
    if row["refused"]:
        assert file.name.startswith("broken")
        return
    assert row["nodes"].count == row["nodes"].of
    assert row["units"].count + row["online"] == row["units"].of
    assert row["tags"].of - row["tags"].count <= 2  # terminations among the tags, in one file


def test_import_costs_a_few_readings_of_the_xml() -> None:
    """CPU time as a ratio to the plain walk of the same files in the same run.

    Alone the import takes some three times the walk; a limit in seconds fails
    on a machine that is busy.
    """
    good = [file for file in files() if not file.name.startswith("broken")]
    assert seconds(good) < 6.0 * plain_seconds(good)
