"""A small measurement of some figures, held against what is printed."""

from __future__ import annotations

import functools
from typing import Any

import pytest

from tests.conftest import recordings_folder
from tests.figures.commands import output_here, picked, quick_verdict
from tests.figures.ledger import Figure, read_ledger

QUICK = [f for f in read_ledger().figures.values() if f.quick]


@functools.cache
def output(command: str) -> Any:
    """What a command gives; once for all its figures."""
    return output_here(command)


@pytest.mark.parametrize("figure", QUICK, ids=lambda f: f.id)
def test_what_is_printed_is_still_true(figure: Figure) -> None:
    """If this fails: mend what changed the figure, or `make figures ONLY=...` and say why."""
    assert figure.quick is not None
    if figure.needs and not (recordings_folder() / figure.needs).exists():
        pytest.skip(f"no recording {figure.needs}")
    found = picked(output(figure.quick.command), figure.quick.key)
    assert "" == quick_verdict(figure, found)


def test_isolation_is_among_them() -> None:
    """It once went from 0.98 to 0.86 and nobody saw it."""
    assert {f"isolation.sound-start.0.{k}" for k in (1, 2, 3)} <= {f.id for f in QUICK}
