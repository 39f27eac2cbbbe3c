"""A ruleset in a file, and a disk that is soon full."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import compiled


@pytest.fixture
def rules(tmp_path: Path) -> Path:
    file = tmp_path / "abc.ruleset.json"
    file.write_text(compiled("abc").to_json(), encoding="utf-8")
    return file


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 200 kB."""
    folder = tmp_path / "small"
    folder.mkdir()
    options = ["-t", "tmpfs", "-o", "size=200k", "tmpfs"]
    mounted = (
        os.geteuid() == 0
        and not subprocess.run(
            ["mount", *options, str(folder)], capture_output=True, check=False
        ).returncode
    )
    if not mounted:
        pytest.skip("mounting a small file system needs root")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)
