"""A table of goals below the benchmark's own: `pytest tests/bench -s`.

Medians, as the machine may be shared. A missed goal is shown, not failed: only results that
differ fail a benchmark. `python -m tests.bench.goals` gives what has a key as JSON.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from tests.bench.goals import FILE

ROWS = pytest.StashKey[list[tuple[str, str, str]]]()
KEPT = pytest.StashKey[dict[str, float]]()


@pytest.fixture(scope="session", autouse=True)
def _each_text_read_once() -> None:
    """Not where time is measured."""


class Results:
    """Collects lines for the table."""

    def __init__(self, rows: list[tuple[str, str, str]], kept: dict[str, float]) -> None:
        self._rows, self._kept = rows, kept

    def add(
        self, what: str, found: float, unit: str, goal: float | None = None, key: str = ""
    ) -> None:
        """One figure, with its goal if there is one (smaller is better), and a key if a page
        prints it."""
        if key:
            self._kept[key] = found
        verdict = "" if goal is None else f"goal {goal:g}: {'met' if found < goal else 'MISSED'}"
        self._rows.append((what, f"{found:.3g} {unit}", verdict))


@pytest.fixture
def results(request: pytest.FixtureRequest) -> Results:
    stash = request.config.stash
    return Results(stash.setdefault(ROWS, []), stash.setdefault(KEPT, {}))


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    rows = config.stash.get(ROWS, [])
    if rows:
        terminalreporter.section("goals")
    for what, found, verdict in rows:
        terminalreporter.write_line(f"{what:<62}{found:>16}   {verdict}")
    if FILE in os.environ:
        text = json.dumps(config.stash.get(KEPT, {}), indent=1)
        Path(os.environ[FILE]).write_text(text + "\n", encoding="utf-8")
