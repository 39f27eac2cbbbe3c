"""Fixtures of the suite's own tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from rulec.prove import campaign


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cases are worked on here, one after the other: three processes take longer to start."""

    def here(
        work: Callable[..., Any],
        todo: Sequence[tuple[Any, ...]],
        jobs: int,
        told: Callable[[int], None],
    ) -> Iterator[Any]:
        for count, words in enumerate(todo, 1):
            yield work(*words)
            told(count)

    monkeypatch.setattr(campaign, "spread", here)
