"""Print answers as tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from tests.rig.mismatch.ask import Answer
from tests.rig.mismatch.case import Case

TITLES = (
    "case",
    "verdict",
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
            table.add_row(case.name, answer.verdict, *_fit(answer))
    out.print(table)
    for case, answer in answers:
        if not isinstance(answer, str):
            show_lines(out, f"{case.name}: named", _named(answer))
        if case.by_hand:
            out.print(f"  by hand: {case.by_hand}\n", style="dim", markup=False)


def _named(answer: Answer) -> list[str]:
    """Effect, place, probability, parameters and other explanations, one line each."""
    lines = []
    for effect in answer.form["effects"]:
        name, place = effect["effect"], f"{effect['module']}.{effect['place']}"
        others = ", ".join(
            f"{a['effect']} {_number(a['probability'], 2)}" for a in effect.get("alternatives", ())
        )
        shown = ", ".join(f"{k} {_value(v)}" for k, v in effect["parameters"].items())
        line = f"{name}, {place} ({_number(effect['probability'])}): {shown}"
        lines.append(f"{line}; or {others}" if others else line)
    return lines


def _value(parameter: Mapping[str, Any]) -> str:
    return f"{_number(parameter['value'], 4)}+-{_number(parameter['u'], 1)} {parameter['unit']}"


def _number(value: float | None, digits: int = 3) -> str:
    """What is no finite number is null in the machine form."""
    return "-" if value is None else f"{value:.{digits}g}"


def _fit(answer: Answer) -> tuple[str, ...]:
    """Errors of every signal that was predicted, one below the other."""
    form = answer.form
    fits = form.get("fits") or ([form["fit"]] if form["fit"] else [])
    columns = zip(*(_cells(fit) for fit in fits), strict=True)
    return (
        *(("\n".join(column) for column in columns) if fits else [""] * 6),
        f"{answer.seconds:.1f}",
    )


def _cells(fit: Mapping[str, Any]) -> tuple[str, ...]:
    held = fit["heldout"]
    return (
        f"{fit['signal']} [{fit['unit']}]",
        _three(fit["estimation"]),
        _three(held),
        _number(held["noise"]),
        _number(fit["closed"]),
        " to ".join(_number(gain) for gain in held["gain_interval"]),
    )


def _three(errors: Mapping[str, float]) -> str:
    kinds = ("shipped", "recalibrated", "repaired")
    return " / ".join(_number(errors[kind]) for kind in kinds)


def show_lines(out: Console, title: str, lines: Iterable[str]) -> None:
    """A heading and what was measured."""
    out.print(f"[bold]{title}[/]")
    for line in lines:
        out.print(f"  {line}", highlight=False)
    out.print()
