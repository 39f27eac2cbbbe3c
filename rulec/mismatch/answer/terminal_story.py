"""A comparison as a story of one screen: the finding, the evidence, the numbers, the next step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from rich.bar import Bar
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text
from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.report.text import counted, number, period

from rulec.effects.candidate import TIME
from rulec.mismatch.answer.power_words import power_words
from rulec.mismatch.answer.sparkline import sparkline
from rulec.mismatch.answer.text_plot import text_plot
from rulec.mismatch.answer.wording import (
    confounded_words,
    errors_of,
    evidence_rows,
    evidence_words,
    explained_words,
    finding_facts,
    fit_words,
    hidden_facts,
    interval,
    is_repaired,
    labelled,
    letter,
    meaning,
    of_recordings_words,
    other_fits,
    place_facts,
    proof,
    proof_title,
    rivals_words,
    symbol,
    value_and_u,
    where_of,
)
from rulec.mismatch.result import Finding, Fit, HiddenDriver, Location, Mismatch

_COLOURS = {"F": "red", "C": "dark_orange", "S": "yellow", "M": "blue", "ok": "green"}

SHOWN = 3
"""Findings, places, rivals, alternatives and remarks shown of each kind."""

BAR = 30
COURSE = 60
"""Characters of an error bar and of the course of a hidden driver."""


def tell(out: Console, mismatch: Mismatch) -> None:
    """Print the whole story."""
    colour = _COLOURS[letter(mismatch)]
    out.print(styled("\n[bold {}]{} {}[/]", colour, symbol(mismatch), meaning(mismatch)))
    out.print(styled("[dim]{}, {}[/]", mismatch.title, mismatch.recording))
    if mismatch.headline:
        _heading(out, mismatch.headline)
    _facts(out, _findings(mismatch))
    if mismatch.recordings:
        _heading(out, "Recordings")
        _facts(out, of_recordings_words(mismatch))
    if mismatch.hidden is not None:
        _heading(out, "What drives it is not recorded")
        _facts(out, hidden_facts(mismatch.hidden, tuple(_drawn(mismatch.hidden))))
    if mismatch.fit is not None:
        _evidence(out, mismatch, mismatch.fit)
    _numbers(out, mismatch)
    if mismatch.next:
        _heading(out, "Next")
        out.print(_inset(Text(mismatch.next, "bold")))
    _small_print(out, mismatch)
    if mismatch.power is not None:
        _heading(out, "What this recording can tell")
        for text in power_words(mismatch.power):
            out.print(_inset(Text(text)))


def _heading(out: Console, title: str) -> None:
    out.print(styled("\n[bold]{}[/]", title))


def _facts(out: Console, rows: Iterable[tuple[str, str]]) -> None:
    """Terms and what is to be said of them."""
    table = Table(box=None, show_header=False, padding=(0, 1), pad_edge=False)
    table.add_column(style="dim", min_width=9, no_wrap=True)
    table.add_column(overflow="fold")
    for term, text in rows:
        table.add_row(one_line(term), one_line(text))
    if table.row_count:
        out.print(_inset(table))


def _inset(content: RenderableType) -> Padding:
    return Padding(content, (0, 0, 0, 2))


def _findings(mismatch: Mismatch) -> Iterator[tuple[str, str]]:
    """What was found, each with its place; then places where nothing was found."""
    places = list(mismatch.locations)
    for finding in mismatch.findings[:SHOWN]:
        yield "what", finding.text
        # Two findings may be of one place; places stand in the order of findings.
        here = [p for p in places if f"{p.module}.{p.place}" in where_of(finding).split()]
        for location in here if finding.sort == "structure" else here[:1]:
            places.remove(location)
            yield from place_facts(location, _shape(location))
        yield from finding_facts(finding, SHOWN)
    if len(mismatch.findings) > SHOWN:
        left = len(mismatch.findings) - SHOWN
        yield "", f"and {counted(left, 'other finding')} (--json has all)"
        return
    for location in places[:SHOWN]:
        yield from place_facts(location, _shape(location))
    if len(places) > SHOWN:
        yield "", f"and {counted(len(places) - SHOWN, 'other place')}"


def _shape(location: Location) -> list[str]:
    """The shape of what has no name as rows of characters; of a course in time another one is
    drawn."""
    shape = location.shape
    if shape is None or shape.driver == TIME:
        return []
    return text_plot(shape.at, shape.value, shape.u, (shape.driver_unit, shape.unit))


def _drawn(hidden: HiddenDriver) -> Iterator[str]:
    """The course of a hidden driver as one row of characters, and its ends."""
    drawn = sparkline(hidden.course, COURSE)
    if drawn:
        seen = hidden.course[np.isfinite(hidden.course)]
        yield drawn
        ends = f"{number(float(seen.min()))} to {number(float(seen.max()))} {hidden.unit}"
        yield f"{ends} {period(float(hidden.time[0]), float(hidden.time[-1]))}"


def _evidence(out: Console, mismatch: Mismatch, fit: Fit) -> None:
    """Errors of the models with bars, what they prove, and the rivals that lost."""
    title = "\n[bold]{}: error of {} [dim]({}, rms)[/][/]"
    out.print(styled(title, proof_title(mismatch), fit.signal, fit.unit))
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    for title in ("", "fitted", "held out", ""):
        justify = "left" if not title else "right"
        table.add_column(title, justify=justify, header_style="dim", no_wrap=True)  # type: ignore[arg-type]
    repaired = is_repaired(mismatch)
    rows = errors_of(fit, repaired)
    largest = max((kept for _, _, kept in rows if np.isfinite(kept)), default=0.0)
    for name, seen, kept in rows:
        table.add_row(name, number(seen), number(kept), _bar(name, kept, largest))
    out.print(_inset(table))
    out.print(_inset(Text(proof(mismatch, fit))))
    if words := explained_words(mismatch):
        out.print(_inset(Text(words)))
    _facts(out, (("also", fit_words(f, repaired)) for f in other_fits(mismatch)[:SHOWN]))
    for finding in mismatch.findings[:SHOWN]:
        if finding.rivals:
            out.print(_inset(Text(rivals_words(finding))))


def _rows_used(mismatch: Mismatch) -> Iterator[tuple[str, str]]:
    """What the rows of the recording served for, and why others were not used."""
    told = evidence_rows(mismatch)
    if told:
        serving = "; ".join(f"{part.rows} {part.because}" for part in told if part.used)
        yield "rows", evidence_words(mismatch) + (f": {serving}" if serving else "")
    for part in told:
        if not part.used:
            yield "not used", f"{part.rows}: {part.because}"


def _bar(name: str, value: float, largest: float) -> RenderableType:
    if not (np.isfinite(value) and largest > 0):
        return Text("")
    colour = {"repaired": "green", "noise alone": "bright_black"}.get(name, "default")
    return Bar(1.0, 0.0, min(value / largest, 1.0), width=BAR, color=colour)


def _numbers(out: Console, mismatch: Mismatch) -> None:
    """Parameters with their uncertainty, and what remains in doubt."""
    shown = [f for f in mismatch.findings[:SHOWN] if f.parameters and f.sort != "free"]
    doubts = [*_doubts(mismatch), *_rows_used(mismatch)]
    if shown or doubts:
        _heading(out, "Numbers")
    if shown:
        out.print(_inset(_parameters(shown)))
    for finding in shown:
        if finding.equation and finding.sort != "free":
            out.print(_inset(Text(f"{finding.module}: {finding.equation}", "dim")))
    _facts(out, doubts)


def _parameters(findings: Iterable[Finding]) -> Table:
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    for title in ("parameter", "value", "u", "95 % interval", "unit"):
        right = title in ("value", "u")
        table.add_column(
            title,
            justify="right" if right else "left",
            header_style="dim",
            no_wrap=title != "parameter",
        )
    for finding in findings:
        for label, e in labelled(finding):
            value, u = value_and_u(e)
            unit = "" if e.unit == "1" else e.unit
            table.add_row(label, value, u, interval(e), unit)
    return table


def _doubts(mismatch: Mismatch) -> Iterator[tuple[str, str]]:
    for strain in mismatch.strain[:SHOWN]:
        yield "strained", str(strain)
    for pair in mismatch.confounded[:SHOWN]:
        yield "confounded", confounded_words(pair)
    for text in mismatch.untested[:SHOWN]:
        yield "untested", text


def _small_print(out: Console, mismatch: Mismatch) -> None:
    parts = [mismatch.split, mismatch.noise]
    if mismatch.tried:
        parts.append(f"{counted(mismatch.tried, 'candidate')} tried")
    parts.append(f"{number(mismatch.seconds, 2)} s")
    out.print(styled("\n[dim]{}[/]", "; ".join(p for p in parts if p)))
    for note in mismatch.notes[:SHOWN]:
        out.print(styled("[dim]note: {}[/]", note))
    if len(mismatch.notes) > SHOWN:
        left = len(mismatch.notes) - SHOWN
        out.print(styled("[dim]and {} (--json has all)[/]", counted(left, "other note")))
