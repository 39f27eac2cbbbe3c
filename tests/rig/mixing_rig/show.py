"""Figures as tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

from rich.console import Console
from rich.table import Table

from tests.rig.mixing_rig.goals import Goal
from tests.rig.mixing_rig.judge import Answer, Judged
from tests.rig.mixing_rig.measure import (
    COLUMNS,
    ROWS,
    alarm_figures,
    degree_figures,
    figure_11,
    grouped,
    isolation_figures,
    kind_of,
    pair_figures,
    sample_figures,
)


def show_leakage(out: Console, judged: Judged) -> None:
    """Samples judged alone, then whole plateaus."""
    rows = {}
    for group, mode in dict.fromkeys((s.group, s.mode) for s in judged.samples):
        parts = [s for s in judged.samples if (s.group, s.mode) == (group, mode)]
        rows[f"{group}, {mode}"] = sample_figures(parts, "A.leakage")
    _table(out, "leakage in A, 0/0.2/0/0.4/0/0.6: every settled sample on its own", rows)
    by_mode = grouped(judged.answers, lambda a: f"{a.group}, {a.mode}")
    figures = {name: degree_figures(part) for name, part in by_mode.items()}
    _table(out, "leakage in A: one finding per plateau", figures)


def show_degrees(out: Console, judged: Judged) -> None:
    """All faults: whole, by type, by degree, and as Figure 11."""
    by_mode = grouped(judged.answers, lambda a: a.mode)
    figures = {mode: degree_figures(part) for mode, part in by_mode.items()}
    _table(out, "all faults, stationary points", figures)
    for mode, part in by_mode.items():
        for what, key in (("type", kind_of), ("degree", _degree)):
            rows = {name: degree_figures(group) for name, group in grouped(part, key).items()}
            _table(out, f"{mode} mode by {what}", rows)
        _figure_11(out, mode, part)
    _show_widths(out, by_mode)


def show_isolation(out: Console, judged: Judged) -> None:
    """By plant and number of operating points; then by degree and by type."""
    for group, part in grouped(judged.answers, lambda a: a.group).items():
        rows = {"all": isolation_figures(part)}
        for key in (_degree, kind_of):
            rows |= {name: isolation_figures(some) for name, some in grouped(part, key).items()}
        _table(out, f"isolation, {group}", rows)


def show_pairs(out: Console, judged: Judged) -> None:
    """By number of operating points."""
    groups = grouped(judged.answers, lambda a: a.group)
    _table(out, "two faults at once", {name: pair_figures(part) for name, part in groups.items()})


def show_alarms(out: Console, judged: Judged) -> None:
    """By mode."""
    rows = {}
    for mode in dict.fromkeys(c.mode for c in judged.covered):
        covered = [c for c in judged.covered if c.mode == mode]
        rows[mode] = alarm_figures(covered, [s for s in judged.samples if s.mode == mode])
    _table(out, "fault-free recordings", rows)


def show_goals(out: Console, goals: Sequence[Goal]) -> None:
    """What was asked for, and what came out."""
    table = Table(title="goals", box=None, title_justify="left")
    for title in ("", "from", "to", "measured", ""):
        table.add_column(title, justify="right" if title else "left")
    for goal in goals:
        numbers = (f"{v:.6g}" for v in (goal.low, goal.high, goal.measured))
        table.add_row(goal.what, *numbers, "met" if goal.met else "missed")
    out.print(table)


SHOW: Mapping[str, Callable[[Console, Judged], None]] = {
    "leakage": show_leakage,
    "degrees": show_degrees,
    "isolation": show_isolation,
    "pairs": show_pairs,
    "alarms": show_alarms,
}


def _degree(answer: Answer) -> str:
    return f"degree {answer.set_degree:g}"


def _show_widths(out: Console, by_mode: Mapping[str, Sequence[Answer]]) -> None:
    """Widths of both modes over the cases that both name rightly."""
    right = {
        mode: {a.case: a for a in part if a.named and a.named[0].fault in a.true}
        for mode, part in by_mode.items()
    }
    common = set.intersection(*(set(cases) for cases in right.values()))
    table = Table(title="mean width of the bounds, cases that both modes name rightly", box=None)
    for title in ("type", "cases", *right):
        table.add_column(title, justify="left" if title == "type" else "right")
    first = next(iter(right.values()))
    chosen = [first[case] for case in sorted(common)]
    for name, part in {"all": chosen, **grouped(chosen, kind_of)}.items():
        widths = [
            sum(cases[a.case].named[0].upper - cases[a.case].named[0].lower for a in part)
            / max(len(part), 1)
            for cases in right.values()
        ]
        table.add_row(name, str(len(part)), *(_cell(w) for w in widths))
    out.print(table, "")


def _figure_11(out: Console, mode: str, answers: Sequence[Answer]) -> None:
    shares = figure_11(answers)
    table = Table(title=f"Figure 11, {mode} mode: share of the cases named rightly", box=None)
    for title in ("discrepancy", *COLUMNS, "total"):
        table.add_column(title, justify="right")
    for row, cells in zip(ROWS, shares, strict=True):
        table.add_row(f"{row:g}", *(f"{c:.2f}" for c in cells), f"{cells.sum():.2f}")
    out.print(table, "")


def _table(out: Console, title: str, rows: Mapping[str, Any]) -> None:
    """A row per name, a column per field of the figures."""
    table = Table(title=title, box=None, title_justify="left")
    table.add_column("")
    names = [f.name for f in fields(next(iter(rows.values())))]
    for name in names:
        table.add_column(name.replace("_", " "), justify="right")
    for name, figures in rows.items():
        table.add_row(name, *(_cell(getattr(figures, n)) for n in names))
    out.print(table, "")


def _cell(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(value) or "-"
    return f"{value:.4f}" if isinstance(value, float) else str(value)
