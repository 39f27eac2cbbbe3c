"""What a result is made of, for a terminal and for a page: sentences, lists, terms, tables."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any, TypeAlias

from rich.console import Console, Group, JustifyMethod, RenderableType
from rich.padding import Padding
from rich.table import Table as Grid
from rich.text import Text

from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.report.text import Html, safe


@dataclass(frozen=True)
class Words:
    """A sentence; `soft` if it only explains others."""

    text: str
    soft: bool = False


@dataclass(frozen=True)
class Items:
    """A list of sentences, perhaps `numbered`."""

    lines: Sequence[str]
    numbered: bool = False


@dataclass(frozen=True)
class Facts:
    """Terms, each with lines of text; without any it is left out. `style` is a class of a page."""

    rows: Sequence[tuple[str, Sequence[str]]]
    style: str = ""


@dataclass(frozen=True)
class Cell:
    """Lines of a cell with classes for a page; those of a first cell are of its row."""

    text: str | Sequence[str]
    style: str = ""


@dataclass(frozen=True)
class Table:
    """A table; titles of columns of numbers begin with a dot, of centred ones with a colon.

    Titles and cells may have several lines; `Text` is for a terminal only. On a narrow terminal
    columns of words may be broken, or those in `broken`; on a narrow page rows become cards, but in
    a table with a `style`, which has titles of rows. `name` says what it shows, for screen readers,
    if its heading does not.
    """

    titles: Sequence[str]
    rows: Sequence[Sequence[str | Cell | Text | Sequence[str]]]
    name: str = ""
    broken: Collection[str] | None = None
    style: str = ""


Content: TypeAlias = Words | Items | Facts | Table | Html
"""What may stand below a heading; `Html`, such as pictures, on a page only."""


@dataclass(frozen=True)
class Part:
    """A heading, empty if there is none, with what stands below it; one with a letter of NE 107 is
    a card on a page."""

    title: str
    content: Sequence[Content]
    letter: str = ""


MARKS = {
    "✓": ("green", "agrees"),
    "✗": ("red", "contradicts"),
    "~": ("yellow", "weaker"),
    "–": ("dim", "soft"),
    "·": ("dim", "soft"),
}
"""Styles of a cell on a terminal and on a page, by its first character."""

PLAIN = "", ""

COLUMNS: dict[str, tuple[JustifyMethod, str]] = {".": ("right", "num"), ":": ("center", "mid")}
"""How a column stands on a terminal and on a page, by the first character of its title."""


def tell(out: Console, parts: Iterable[Part], margin: int = 0) -> None:
    """Print parts; `margin` is how far what stands below a heading is moved in."""
    for part in parts:
        if part.title:
            out.print(styled("\n[bold]{}[/]", part.title))
        for content in part.content:
            out.print(Padding(shown(content), (0, 0, 0, margin), expand=False))


def shown(content: Content) -> RenderableType:
    """Content for a terminal."""
    match content:
        case Words():
            return Text(one_line(content.text), "dim" if content.soft else "")
        case Items():
            marks = (f"{i}  " * content.numbered for i in range(1, len(content.lines) + 1))
            return Group(
                *(Text(m + one_line(line)) for m, line in zip(marks, content.lines, strict=True))
            )
        case Facts():
            return _terms(content)
        case Table():
            return _grid(content)
    return Group()


def _terms(facts: Facts) -> Grid:
    """Terms in a column, their lines beside them."""
    grid = Grid(box=None, show_header=False, padding=(0, 1), pad_edge=False)
    grid.add_column(style="dim", min_width=9, no_wrap=True)
    grid.add_column(overflow="fold")
    for term, lines in facts.rows:
        for i, line in enumerate(lines):
            grid.add_row(one_line("" if i else term), one_line(line))
    return grid


def _grid(table: Table) -> Grid:
    """A table; lines of cells that belong together stay beside each other."""
    grid = Grid(box=None, padding=(0, 1), pad_edge=False, header_style="dim")
    for title in table.titles:
        name, justify = title.lstrip(".:"), COLUMNS.get(title[:1], ("left", ""))[0]
        whole = name != title if table.broken is None else name not in table.broken
        grid.add_column(name, justify=justify, no_wrap=whole)
    for row in table.rows:
        for cells in zip_longest(*map(_lines, row), fillvalue=""):
            grid.add_row(*map(_marked, cells))
    return grid


def _lines(cell: str | Cell | Text | Sequence[str]) -> Sequence[Any]:
    if isinstance(cell, Cell):
        return _lines(cell.text)
    return [cell] if isinstance(cell, str | Text) else cell


def _marked(cell: str | Text) -> Text:
    return Text(one_line(cell), MARKS.get(cell[:1], PLAIN)[0]) if isinstance(cell, str) else cell


def part_html(part: Part) -> str:
    """A part as a section of a page."""
    body, title = "".join(html(one, part.title) for one in part.content), safe(part.title)
    if part.letter:
        return f'<section class="finding is-{part.letter}"><h3>{title}</h3>{body}</section>'
    return f"<section><h2>{title}</h2>{body}</section>\n" if title else body


def html(content: Content, name: str = "") -> str:
    """Content for a page, below a heading of this name."""
    match content:
        case Words():
            return f"<p{_class('soft' * content.soft)}>{safe(content.text)}</p>"
        case Items():
            kind = "ol" if content.numbered else "ul"
            return f"<{kind}>{''.join(f'<li>{safe(line)}</li>' for line in content.lines)}</{kind}>"
        case Facts():
            body = "".join(
                f"<dt>{safe(term)}</dt>" + "".join(f"<dd>{safe(line)}</dd>" for line in lines)
                for term, lines in content.rows
                if lines
            )
            return f"<dl{_class(content.style)}>{body}</dl>"
        case Table():
            return framed(content.name or name, _table(content))
    return content


def framed(name: str, body: str) -> str:
    """A frame in which wide content scrolls, also by keyboard."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{safe(name)}">{body}</div>'


def _table(table: Table) -> str:
    columns = [(t.lstrip(".:"), COLUMNS.get(t[:1], PLAIN)[1]) for t in table.titles]
    head = "".join(f'<th scope="col"{_class(s)}>{_broken(title)}</th>' for title, s in columns)
    body = ""
    for row in table.rows:
        style = row[0].style if isinstance(row[0], Cell) else ""
        cells = zip(range(len(row)), columns, row, strict=True)
        body += f"<tr{_class(style)}>{''.join(_cell(table, *one) for one in cells)}</tr>"
    kind = _class(table.style or "fold")
    return f"<table{kind}><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _broken(title: str) -> str:
    return "<br/>".join(map(safe, title.split("\n")))


def _cell(table: Table, index: int, column: tuple[str, str], cell: Any) -> str:
    (title, style), lines = column, _lines(cell)
    own = MARKS.get("".join(lines)[:1], PLAIN)[1]
    if isinstance(cell, Cell) and index:
        own = cell.style
    text = "<br/>".join(safe(_typeset(line, style)) for line in lines)
    if table.style and not index:
        return f'<th scope="row">{text}</th>'
    # A card repeats the titles; its first cell is the heading.
    label = f' data-of="{safe(title)}"' if title and index and not table.style else ""
    return f"<td{_class(f'{style} {own}'.strip())}{label}>{text}</td>"


def _typeset(text: str, style: str) -> str:
    """Numbers with a true minus, and with dashes between them and where there is none; a sign with
    a true minus."""
    if style == "num":
        text = "–" if text == "-" else re.sub(r"(?<=\d)-(?=\d)", "–", text)
    return f"−{text[1:]}" if style and text.startswith("-") else text


def _class(style: str) -> str:
    return f' class="{style}"' if style else ""
