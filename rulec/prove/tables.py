"""Tables in the terminal and on a page."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich.console import Console, JustifyMethod
from rich.table import Table as Grid
from rich.text import Text
from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.report import tables as of_pages
from rulec_runtime.report.document import section
from rulec_runtime.report.text import safe

MARKS = {"✓": ("green", "agrees"), "✗": ("red", "contradicts"), "–": ("dim", "soft")}
"""Styles of cells in the terminal and on a page, by their first character."""


@dataclass(frozen=True)
class Table:
    """A table with its title and a remark; headings of numeric columns begin with a dot."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


def tell(out: Console, tables: Iterable[Table]) -> None:
    """Print tables; columns of words may be wrapped."""
    for one in tables:
        if one.title:
            out.print(styled("\n[bold]{}[/]", one.title))
        grid = Grid(box=None, pad_edge=False, collapse_padding=True)
        for heading in one.headings:
            numeric = heading.startswith(".")
            justify: JustifyMethod = "right" if numeric else "left"
            grid.add_column(heading.removeprefix("."), justify=justify, no_wrap=numeric)
        for row in one.rows:
            grid.add_row(*(Text(one_line(cell), _styles(cell)[0]) for cell in row))
        out.print(grid)
        if one.note:
            out.print(styled("[dim]{}[/]", one.note))


def sections(tables: Iterable[Table], untitled: str = "") -> str:
    """Write tables as sections of a page; one without a title gets `untitled`."""
    found = []
    for one in tables:
        rows = ([of_pages.Cell(safe(c), _styles(c)[1]) for c in row] for row in one.rows)
        title = one.title or untitled
        body = of_pages.table(title, of_pages.columns(*one.headings), rows)
        note = f'<p class="soft">{safe(one.note)}</p>' if one.note else ""
        found.append(section(safe(title), body + note))
    return "".join(found)


def _styles(cell: str) -> tuple[str, str]:
    return MARKS.get(cell[:1], ("", ""))
