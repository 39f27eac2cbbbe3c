"""A table of goals below the benchmark's own: `pytest tests/bench -s`.

The machine may be shared: processor time, the least or the median of some. A missed goal is shown,
not failed: only results that differ fail a benchmark. `python -m tests.bench.goals` gives what has
a key as JSON.
"""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.bench.goals import FILE

Add = Callable[..., None]
ROWS = pytest.StashKey[list[tuple[str, float, str, float | None, str]]]()


@pytest.fixture(scope="session", autouse=True)
def _each_text_read_once() -> None:
    """Not where time is measured."""


@pytest.fixture
def add(request: pytest.FixtureRequest) -> Add:
    """Takes a line for the table: what, the figure, its unit; the goal if there is one (smaller is
    better); a key if a page prints it."""
    rows = request.config.stash.setdefault(ROWS, [])

    def added(what: str, found: float, unit: str, goal: float | None = None, key: str = "") -> None:
        rows.append((what, found, unit, goal, key))

    return added


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    rows = config.stash.get(ROWS, [])
    if rows:
        terminalreporter.section("goals")
    for what, found, unit, goal, _ in rows:
        verdict = "" if goal is None else f"goal {goal:g}: {'met' if found < goal else 'MISSED'}"
        terminalreporter.write_line(f"{what:<62}{f'{found:.3g} {unit}':>16}   {verdict}")
    if FILE in os.environ:
        text = json.dumps({key: found for _, found, *_, key in rows if key}, indent=1)
        Path(os.environ[FILE]).write_text(text + "\n", encoding="utf-8")
