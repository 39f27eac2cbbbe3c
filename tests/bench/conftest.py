"""A table of goals below the benchmark's own: `pytest tests/bench -s`.

Medians, as the machine may be shared. A missed goal is shown, not failed: only results that
differ fail a benchmark.
"""

from __future__ import annotations

import pytest

ROWS = pytest.StashKey[list[tuple[str, str, str]]]()


@pytest.fixture(scope="session", autouse=True)
def _each_text_read_once() -> None:
    """Not where time is measured."""


class Results:
    """Collects lines for the table."""

    def __init__(self, rows: list[tuple[str, str, str]]) -> None:
        self._rows = rows

    def add(self, what: str, found: float, unit: str, goal: float | None = None) -> None:
        """One figure, with its goal if there is one (smaller is better)."""
        verdict = "" if goal is None else f"goal {goal:g}: {'met' if found < goal else 'MISSED'}"
        self._rows.append((what, f"{found:.3g} {unit}", verdict))


@pytest.fixture
def results(request: pytest.FixtureRequest) -> Results:
    return Results(request.config.stash.setdefault(ROWS, []))


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    rows = config.stash.get(ROWS, [])
    if rows:
        terminalreporter.section("goals")
    for what, found, verdict in rows:
        terminalreporter.write_line(f"{what:<62}{found:>16}   {verdict}")
