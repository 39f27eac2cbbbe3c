"""A ruleset in a file, and a disk that is soon full."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import compiled
from tests.live.disks import mounted


@pytest.fixture
def rules(tmp_path: Path) -> Path:
    file = tmp_path / "abc.ruleset.json"
    file.write_text(compiled("abc").to_json(), encoding="utf-8")
    return file


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    with mounted(tmp_path / "small", "200k") as there:
        if not there:
            pytest.skip("mounting a small file system needs root")
        yield tmp_path / "small"
