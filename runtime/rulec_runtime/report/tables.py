"""Tables of pages: on a narrow screen rows become cards, or the table scrolls in its frame."""

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
    """Content of a cell as HTML, and classes in addition to those of its column."""

    html: str
    style: str = ""


def columns(*titles: str) -> list[Column]:
    """Columns by their titles; titles of numeric columns begin with a dot.

    >>> columns("model", ".error")
    [Column(title='model', style=''), Column(title='error', style='num')]
    """
    return [Column(t[1:], "num") if t.startswith(".") else Column(t) for t in titles]


def table(name: str, of: Sequence[Column], rows: Iterable[Sequence[Cell | str]]) -> str:
    """A table that becomes cards on a narrow page.

    Parameters
    ----------
    name : what it shows, for screen readers.
    rows : a cell per column, as HTML.
    """
    head = "".join(f'<th scope="col"{_class(c.style)}>{safe(c.title)}</th>' for c in of)
    body = "".join(f"<tr>{_row(of, row)}</tr>" for row in rows)
    return framed(
        name,
        f'<table class="fold"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>',
    )


def framed(name: str, body: str) -> str:
    """A frame in which wide content scrolls, also by keyboard."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{safe(name)}">{body}</div>'


def _row(of: Sequence[Column], row: Sequence[Cell | str]) -> str:
    parts = []
    for i, (column, text) in enumerate(zip(of, row, strict=True)):
        cell = text if isinstance(text, Cell) else Cell(text)
        # A card repeats the titles; its first cell is the heading.
        label = f' data-of="{safe(column.title)}"' if column.title and i else ""
        style = _class(f"{column.style} {cell.style}".strip())
        parts.append(f"<td{style}{label}>{cell.html}</td>")
    return "".join(parts)


def _class(style: str) -> str:
    return f' class="{style}"' if style else ""
