"""Answers on real recordings as one table for the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.text import counted, listed, number

from tests.prove.real import Answer

COVERAGE = 2.0
"""Expanded over standard uncertainty. Source: GUM (JCGM 100:2008), 6.3.3."""

LIKELY = 0.1
"""Probability from which on another name is told beside the first."""

REST = "what is left is not noise: "
"""How a note begins that says where the rest of a mismatch would be explained."""

MODELS = ("shipped", "recalibrated", "repaired")
WORSE = "▲"


def tell_real(out: Console, answers: Sequence[Answer], skipped: Sequence[str]) -> None:
    """Write the table, and what was left out."""
    shown = Table(box=None, pad_edge=False, padding=(0, 1, 1, 0))
    shown.add_column("recording", max_width=15)
    shown.add_column("found, with parameters ± U", ratio=1)
    shown.add_column("reading", no_wrap=True)
    for title in ("shipped", "recal.", "repaired", "noise", "left"):
        shown.add_column(title, justify="right", no_wrap=True)
    for answer in answers:
        words = (answer.case, answer.plant, answer.form.get("verdict", "no answer"))
        title = styled("{}\n[dim]{}[/]\n[bold]{}[/]", *words)
        found = "\n".join(f"• {line}" for line in found_lines(answer.form))
        columns = zip(*map(fit_cells, answer.form.get("fits") or ()), strict=True)
        cells = ("\n".join(column) for column in columns)
        shown.add_row(title, found, *cells)
    seconds = sum(a.form["seconds"] for a in answers)
    asked = counted(len(answers), "real recording")
    out.print(styled("[bold]{}, {} s[/]", asked, number(seconds, 2)))
    legend = (
        f"U = {COVERAGE:g} u, about 95 %; errors: root mean square on held-out samples; "
        f"left: repaired over noise, {WORSE} where the repair did harm"
    )
    out.print(styled("[dim]{}[/]\n", legend))
    out.print(shown)
    for line in skipped:
        out.print(f"skipped: {line}", style="dim", markup=False, soft_wrap=True)


def fit_cells(fit: Mapping[str, Any]) -> tuple[str, ...]:
    """Reading with its unit, errors of three models, noise, and what is left of it."""
    held = fit["heldout"]
    errors = [held[model] for model in MODELS]
    return (f"{fit['signal']} [{fit['unit']}]", *map(_cell, [*errors, held["noise"]]), left(held))


def left(held: Mapping[str, float | None]) -> str:
    """Error of the repaired model over the noise, with a mark where recalibration did better.

    >>> left({"recalibrated": 2.0, "repaired": 3.0, "noise": 1.5})
    '▲ 2.0'
    """
    repaired, noise, before = held["repaired"], held["noise"], held["recalibrated"]
    if repaired is None or not noise:
        return "–"
    mark = f"{WORSE} " if before is not None and repaired > before else ""
    return f"{mark}{repaired / noise:.1f}" if repaired < 100 * noise else f"{mark}> 100"


def found_lines(form: Mapping[str, Any]) -> Iterator[str]:
    """Names with places and parameters, what has no name, and why there is no answer."""
    if "error" in form:
        yield form["error"]
        return
    for effect in form["effects"]:
        yield _named(effect)
    if not form["effects"]:
        yield from (f"? at {p['module']}.{p['place']}" for p in form["locations"])
    if form["hidden_driver"]:
        named = {(e["module"], e["place"]) for e in form["effects"]}
        hidden = (form["hidden_driver"]["module"], form["hidden_driver"]["place"])
        places = ((p["module"], p["place"]) for p in form["locations"])
        follow = dict.fromkeys([hidden, *(place for place in places if place not in named)])
        yield f"unrecorded driver at {listed([f'{m}.{p}' for m, p in follow])}"
    for note in form["notes"]:
        if note.startswith(REST):
            yield f"not explained: {note.removeprefix(REST).partition(';')[0]}"


def _named(effect: Mapping[str, Any]) -> str:
    """One finding; a free curve has values, no parameters that mean anything."""
    place = f"{effect['module']}.{effect['place']}"
    values = effect["parameters"]
    if effect["sort"] == "free":
        return f"free curve, no name, at {place} ({len(values)} values)"
    told = ", ".join(f"{name} {_value(value)}" for name, value in values.items())
    periods = counted(len(effect["periods"]), "period") if effect["periods"] else ""
    sort = f"{effect['sort']} " if effect["sort"] in ("fault", "sensor") else ""
    text = f"{sort}{effect['effect']} at {place}"
    text += "".join(f": {part}" for part in (told, periods) if part)
    others = [a["effect"] for a in effect["alternatives"] if a["probability"] >= LIKELY]
    return f"{text}; or {', '.join(others)}" if others else text


def _value(parameter: Mapping[str, Any]) -> str:
    unit = "" if parameter["unit"] == "1" else f" {parameter['unit']}"
    doubt = "" if parameter["u"] is None else f" ± {number(COVERAGE * parameter['u'], 2)}"
    return f"{_cell(parameter['value'])}{doubt}{unit}"


def _cell(value: float | None) -> str:
    return "–" if value is None else number(value)
