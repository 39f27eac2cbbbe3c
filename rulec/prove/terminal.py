"""A run in the terminal: the table with goals, and the worst cases."""

from __future__ import annotations

import io

from rich.console import Console
from rich.table import Table
from rulec_runtime.output.terminal import Terminal, one_line, styled
from rulec_runtime.report.text import number

from rulec.prove.page import headline, partition_words
from rulec.prove.results import Run
from rulec.prove.scores import Group, Reliability, Row, by_difficulty, plain, reliability, table
from rulec.prove.second_round_table import tell_further
from rulec.prove.tables import (
    PARTS,
    PLAIN,
    interval_of,
    of_count,
    planted_words,
    said_words,
    told_cells,
    value_of,
)
from rulec.prove.truth.sealed import DIFFICULTIES
from rulec.prove.worst_cases import worst

MARK = {True: "[green]✓[/] {}", False: "[red]✗[/] {}", None: "[dim]–[/] {}"}


def show(out: Console, run: Run) -> None:
    """Print the scores and the worst cases."""
    rows = table(run.judged)
    out.print(styled("[bold]{}[/]", headline(run, rows)))
    out.print(styled("[dim]{}[/]\n", partition_words(run)))
    out.print(_goals(rows, table(plain(run.judged))))
    out.print(styled("[dim]plain to see: {}[/]", PLAIN))
    if bins := reliability(run.judged):
        out.print(styled("\n[bold]Names by their probability[/]"))
        out.print(_probabilities(bins))
    if parts := by_difficulty(run.judged):
        out.print(styled("\n[bold]By difficulty[/]"))
        out.print(_parts(parts))
        for name, words in DIFFICULTIES.items():
            if words in [part.title for part in parts]:
                out.print(styled("[dim]{}: {}[/]", name, words))
    _worst(out, run)
    if run.further:
        tell_further(out, run.judged, run.further)


def _worst(out: Console, run: Run) -> None:
    if not (found := worst(run.judged)):
        return
    shown = Table("case", "planted", "said", "because", box=None, pad_edge=False)
    shown.add_column("strength", justify="right")
    for bad in found:
        j = bad.judged
        strength = "" if j.clean else number(j.gain, 3)
        row = (j.case, planted_words(j), said_words(j), bad.why, strength)
        shown.add_row(*(one_line(w) for w in row))
    out.print(styled("\n[bold]The worst cases[/]"))
    out.print(shown)


def text(run: Run, width: int = 100) -> str:
    """Return the same as text, without colours."""
    out = Terminal(file=io.StringIO(), width=width, color_system=None)
    show(out, run)
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


def _parts(parts: list[Group]) -> Table:
    names = {words: name for name, words in DIFFICULTIES.items()}
    shown = Table("made harder by", box=None, pad_edge=False)
    for part in parts:
        shown.add_column(names.get(part.title, part.title), justify="right")
    shown.add_row("cases", *(str(part.count) for part in parts))
    rows = zip(*(map(of_count, part.shares) for part in parts), strict=True)
    for title, cells in zip(PARTS, rows, strict=True):
        shown.add_row(title, *cells)
    return shown


def _probabilities(bins: list[Reliability]) -> Table:
    shown = Table("told with", box=None, pad_edge=False, collapse_padding=True)
    for title in ("names", "said, mean", "right", "95 % interval"):
        shown.add_column(title, justify="right")
    shown.add_column("")
    for one in bins:
        shown.add_row(*told_cells(one))
    return shown


def _goals(rows: list[Row], plainly: list[Row]) -> Table:
    shown = Table(box=None, pad_edge=False, collapse_padding=True)
    shown.add_column("score", min_width=16)
    for title in ("goal", "cases", "reached", "95 % interval"):
        shown.add_column(title, justify="right", no_wrap=True)
    shown.add_column("", no_wrap=True)
    shown.add_column("plain to see", justify="right", no_wrap=True)
    for row, one in zip(rows, plainly, strict=True):
        cells = (row.goal.text, str(row.count), value_of(row), interval_of(row))
        shown.add_row(row.score, *cells, styled(MARK[row.met], row.verdict), of_count(one))
    return shown
