"""Print answers as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from tests.rig.mismatch.ask import Answer
from tests.rig.mismatch.case import Case

TITLES = (
    "case",
    "verdict",
    "named: effect, place (probability)",
    "signal",
    "estimation",
    "held out",
    "noise",
    "closed",
    "gain",
    "s",
)


def show_answers(out: Console, answers: Sequence[tuple[Case, Answer | str]]) -> None:
    """One row per case: shipped / recalibrated / repaired; failures with their message."""
    table = Table(box=None, padding=(0, 2), pad_edge=False)
    for title in TITLES:
        table.add_column(title, overflow="fold")
    for case, answer in answers:
        if isinstance(answer, str):
            table.add_row(case.name, "[red]failed[/]", answer)
        else:
            table.add_row(case.name, answer.verdict, _named(answer), *_fit(answer))
    out.print(table)
    for case, _ in answers:
        if case.by_hand:
            out.print(f"  [dim]{case.name}, by hand: {case.by_hand}[/]")
    out.print()


def _named(answer: Answer) -> str:
    lines = []
    for effect in answer.form["effects"]:
        name, place = effect["effect"], f"{effect['module']}.{effect['place']}"
        others = ", ".join(
            f"{a['effect']} {a['probability']:.2f}" for a in effect.get("alternatives", ())
        )
        shown = ", ".join(f"{k} {_value(v)}" for k, v in effect["parameters"].items())
        line = f"{name}, {place} ({effect['probability']:.2f}): {shown}"
        lines.append(f"{line}; or {others}" if others else line)
    return "\n".join(lines)


def _value(parameter: Mapping[str, Any]) -> str:
    return f"{parameter['value']:.4g}+-{parameter['u']:.1g} {parameter['unit']}"


def _fit(answer: Answer) -> tuple[str, ...]:
    fit = answer.form["fit"]
    if not fit:
        return ("", "", "", "", "", "", f"{answer.seconds:.1f}")
    held, low_high = fit["heldout"], fit["heldout"]["gain_interval"]
    return (
        f"{fit['signal']} [{fit['unit']}]",
        _three(fit["estimation"]),
        _three(held),
        f"{held['noise']:.3g}",
        f"{fit['closed']:.2f}",
        " to ".join(f"{g:.2f}" for g in low_high),
        f"{answer.seconds:.1f}",
    )


def _three(errors: Mapping[str, float]) -> str:
    kinds = ("shipped", "recalibrated", "repaired")
    return " / ".join(f"{errors[kind]:.3g}" for kind in kinds)


def show_lines(out: Console, title: str, lines: Sequence[str]) -> None:
    """A heading and what was measured."""
    out.print(f"[bold]{title}[/]")
    for line in lines:
        out.print(f"  {line}", highlight=False)
    out.print()
