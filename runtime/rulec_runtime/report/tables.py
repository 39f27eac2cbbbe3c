"""Tables of pages: on a narrow screen rows become cards, or the table scrolls within its frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rulec_runtime.report.text import safe


@dataclass(frozen=True)
class Column:
    """Title of a column, and classes of its cells, such as ``num``."""

    title: str
    style: str = ""


@dataclass(frozen=True)
class Cell:
    """Content of a cell as HTML, and classes beside those of its column."""

    html: str
    style: str = ""


def columns(*titles: str) -> list[Column]:
    """Columns by their titles; those of numbers begin with a point.

    >>> columns("model", ".error")
    [Column(title='model', style=''), Column(title='error', style='num')]
    """
    return [Column(t[1:], "num") if t.startswith(".") else Column(t) for t in titles]


def table(name: str, of: Sequence[Column], rows: Iterable[Sequence[Cell | str]]) -> str:
    """A table that becomes cards where the page is narrow.

    Parameters
    ----------
    name : what it shows, for those who cannot see it.
    rows : a cell per column, as HTML.
    """
    head = "".join(f'<th scope="col"{_class(c.style)}>{safe(c.title)}</th>' for c in of)
    body = "".join(f"<tr>{_row(of, row)}</tr>" for row in rows)
    return framed(
        name,
        f'<table class="fold"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>',
    )


def framed(name: str, body: str) -> str:
    """A frame in which what is too wide scrolls, also by keys."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{safe(name)}">{body}</div>'


def _row(of: Sequence[Column], row: Sequence[Cell | str]) -> str:
    cells = [cell if isinstance(cell, Cell) else Cell(cell) for cell in row]
    return "".join(
        f"<td{_class(f'{column.style} {cell.style}'.strip())}{_named(column, i)}>{cell.html}</td>"
        for i, (column, cell) in enumerate(zip(of, cells, strict=True))
    )


def _named(column: Column, place: int) -> str:
    """The title again, for a card; the first cell is that of the card itself."""
    return f' data-of="{safe(column.title)}"' if column.title and place else ""


def _class(style: str) -> str:
    return f' class="{style}"' if style else ""
