"""A run in the terminal: the table with goals, and the worst cases."""

from __future__ import annotations

import io

from rich.console import Console
from rich.table import Table
from rulec_runtime.output.terminal import Terminal, styled

from rulec.prove.page import headline, partition_words
from rulec.prove.results import Run
from rulec.prove.scores import Group, Row, by_difficulty, plain, reliability, table
from rulec.prove.second_round_table import tell_further
from rulec.prove.tables import (
    PARTS,
    PLAIN,
    bad_cells,
    grid,
    interval_of,
    of_count,
    told_cells,
    value_of,
    worst,
)
from rulec.prove.truth.sealed import DIFFICULTIES

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
        titles = ("told with", ".names", ".said, mean", ".right", ".95 % interval", "")
        out.print(grid(titles, map(told_cells, bins), collapse=True))
    if parts := by_difficulty(run.judged):
        out.print(styled("\n[bold]By difficulty[/]"))
        out.print(_parts(parts))
        for name, words in DIFFICULTIES.items():
            if words in [part.title for part in parts]:
                out.print(styled("[dim]{}: {}[/]", name, words))
    if found := worst(run.judged):
        out.print(styled("\n[bold]The worst cases[/]"))
        of = ("case", "planted", "said", "because", ".strength")
        out.print(grid(of, ((bad.judged.case, *bad_cells(bad)) for bad in found)))
    if run.further:
        tell_further(out, run.judged, run.further)


def text(run: Run, width: int = 100) -> str:
    """Return the same as text, without colours."""
    out = Terminal(file=io.StringIO(), width=width, color_system=None)
    show(out, run)
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


def _parts(parts: list[Group]) -> Table:
    names = {words: name for name, words in DIFFICULTIES.items()}
    titles = ("made harder by", *(f".{names.get(part.title, part.title)}" for part in parts))
    counts = ("cases", *(str(part.count) for part in parts))
    shares = zip(PARTS, *(map(of_count, part.shares) for part in parts), strict=True)
    return grid(titles, (counts, *shares))


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
