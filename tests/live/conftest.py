"""A ruleset in a file, and a disk that is soon full."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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
    with mounted(tmp_path / "small", "200k") as there:
        if not there:
            pytest.skip("mounting a small file system needs root")
        yield tmp_path / "small"


@contextmanager
def mounted(folder: Path, size: str) -> Iterator[bool]:
    """A file system of that size; whether it is there, which needs root."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    there = not os.geteuid() and not subprocess.run(command, check=False).returncode
    try:
        yield there
    finally:
        if there:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def filled(disk: Path) -> Path:
    """A file that takes all the room there is."""
    ballast, piece = disk / "ballast", 1 << 16
    with suppress(OSError), ballast.open("ab", buffering=0) as file:
        while piece:
            try:
                file.write(bytes(piece))
            except OSError:
                piece //= 2
    return ballast
