"""Real rigs: how the tool does on recordings nobody made for it."""

from pathlib import Path

import pytest

from tests.conftest import recordings_folder


def real(name: str = "") -> Path:
    """A part of the real recordings; the test is skipped where it is not at hand."""
    found = recordings_folder() / name
    if not found.exists():
        pytest.skip(f"no real recordings at {found} (set RULEC_RECORDINGS)")
    return found
