"""What a result is made of, for a terminal and for a page: sentences, lists, terms, tables.

A page makes cards of the rows of a table if it is narrow, or the table scrolls in its frame.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any, Protocol

from rich.console import Console, Group, JustifyMethod, RenderableType
from rich.padding import Padding
from rich.table import Table as Grid
from rich.text import Text

from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.report.text import safe

MARKS = {
    "✓": ("green", "agrees"),
    "✗": ("red", "contradicts"),
    "~": ("yellow", "weaker"),
    "–": ("dim", "soft"),
}
"""Styles of a cell on a terminal and on a page, by its first character."""

PLAIN = "", ""


JUSTIFIED: dict[str, JustifyMethod] = {".": "right", ":": "center"}
CLASSES = {".": "num", ":": "mid"}
"""How columns stand on a terminal and on a page, by the first character of their title."""


class Content(Protocol):
    """Something that can be told."""

    def shown(self) -> RenderableType:
        """For a terminal."""

    def html(self) -> str:
        """For a page."""


@dataclass(frozen=True)
class Words:
    """A sentence; `soft` if it only explains others."""

    text: str
    soft: bool = False

    def shown(self) -> RenderableType:
        """The sentence in one paragraph."""
        return Text(one_line(self.text), "dim" if self.soft else "")

    def html(self) -> str:
        """The same as HTML."""
        return f"<p{_class('soft' if self.soft else '')}>{safe(self.text)}</p>"


@dataclass(frozen=True)
class Items:
    """A list of sentences, perhaps `numbered`."""

    lines: Sequence[str]
    numbered: bool = False

    def shown(self) -> RenderableType:
        """A line per sentence."""
        marks = (f"{place}  " if self.numbered else "" for place in range(1, len(self.lines) + 1))
        return Group(*(Text(m + one_line(t)) for m, t in zip(marks, self.lines, strict=True)))

    def html(self) -> str:
        """The list as HTML."""
        kind = "ol" if self.numbered else "ul"
        return f"<{kind}>{''.join(f'<li>{safe(line)}</li>' for line in self.lines)}</{kind}>"


@dataclass(frozen=True)
class Facts:
    """Terms, each with lines of text; a term without lines is left out."""

    rows: Sequence[tuple[str, Sequence[str]]]
    style: str = ""

    def shown(self) -> RenderableType:
        """Terms in a column, their lines beside them."""
        shown = Grid(box=None, show_header=False, padding=(0, 1), pad_edge=False)
        shown.add_column(style="dim", min_width=9, no_wrap=True)
        shown.add_column(overflow="fold")
        for term, lines in self.rows:
            for place, line in enumerate(lines):
                shown.add_row(one_line("" if place else term), one_line(line))
        return shown

    def html(self) -> str:
        """The list as HTML."""
        body = "".join(
            f"<dt>{safe(term)}</dt>" + "".join(f"<dd>{safe(line)}</dd>" for line in lines)
            for term, lines in self.rows
            if lines
        )
        return f"<dl{_class(self.style)}>{body}</dl>"


@dataclass(frozen=True)
class Cell:
    """A cell with classes for a page, in addition to those of its column."""

    text: str
    style: str = ""


Row = Sequence[str | Cell | Text | Sequence[str]]
"""A cell per column; some may have several lines. `Text` is for a terminal only."""


@dataclass(frozen=True)
class Table:
    """A table; titles of columns of numbers begin with a dot, of centred ones with a colon.

    `name` says what it shows, for screen readers. On a narrow terminal only columns of words may be
    broken, or of them those in `broken`.
    """

    titles: Sequence[str]
    rows: Sequence[Row]
    name: str = ""
    broken: Collection[str] | None = None

    def shown(self) -> RenderableType:
        """For a terminal; lines of cells that belong together stay beside each other."""
        grid = Grid(box=None, padding=(0, 1), pad_edge=False, header_style="dim")
        for title, name in zip(self.titles, self._bare, strict=True):
            justify, whole = JUSTIFIED.get(title[:1], "left"), title.startswith((".", ":"))
            whole = whole if self.broken is None else name not in self.broken
            grid.add_column(name, justify=justify, no_wrap=whole)
        for row in self.rows:
            for cells in zip_longest(*map(_lines, row), fillvalue=""):
                grid.add_row(*map(_styled, cells))
        return grid

    def html(self) -> str:
        """For a page, in a frame that scrolls."""
        styles = [CLASSES.get(title[:1], "") for title in self.titles]
        columns = list(zip(self._bare, styles, strict=True))
        head = "".join(f'<th scope="col"{_class(s)}>{safe(name)}</th>' for name, s in columns)
        body = "".join(f"<tr>{''.join(_cells(columns, row))}</tr>" for row in self.rows)
        return framed(
            self.name,
            f'<table class="fold"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>',
        )

    def as_part(self) -> Part:
        """The table below its name."""
        return Part(self.name, [self])

    @property
    def _bare(self) -> list[str]:
        return [title.lstrip(".:") for title in self.titles]


@dataclass(frozen=True)
class Drawing:
    """HTML of a page that a terminal does not show, such as pictures."""

    body: str

    def shown(self) -> RenderableType:
        """Nothing."""
        return Group()

    def html(self) -> str:
        """Itself."""
        return self.body


@dataclass(frozen=True)
class Part:
    """A heading with what stands below it; one with a letter of NE 107 is a card on a page.

    Without a title a terminal shows the content alone, and a page `otherwise`.
    """

    title: str
    content: Sequence[Content]
    letter: str = ""
    otherwise: str = ""

    def html(self) -> str:
        """The part as a section of a page."""
        body = "".join(one.html() for one in self.content)
        if self.letter:
            heading = f"<h3>{safe(self.title)}</h3>"
            return f'<section class="finding is-{self.letter}">{heading}{body}</section>'
        heading = self.title or self.otherwise
        return f"<section><h2>{safe(heading)}</h2>{body}</section>\n" if heading else body


def tell(out: Console, parts: Iterable[Part], margin: int = 0) -> None:
    """Print parts; `margin` is how far what stands below a heading is moved in."""
    for part in parts:
        if part.title:
            out.print(styled("\n[bold]{}[/]", part.title))
        for content in part.content:
            out.print(Padding(content.shown(), (0, 0, 0, margin), expand=False))


def framed(name: str, body: str) -> str:
    """A frame in which wide content scrolls, also by keyboard."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{safe(name)}">{body}</div>'


def _lines(cell: str | Cell | Text | Sequence[str]) -> Sequence[Any]:
    if isinstance(cell, Cell):
        return [cell.text]
    return [cell] if isinstance(cell, str | Text) else cell


def _styled(cell: str | Text) -> Text:
    return Text(one_line(cell), MARKS.get(cell[:1], PLAIN)[0]) if isinstance(cell, str) else cell


def _cells(columns: Sequence[tuple[str, str]], row: Row) -> Iterator[str]:
    for place, ((name, style), cell) in enumerate(zip(columns, row, strict=True)):
        lines = _lines(cell)
        own = cell.style if isinstance(cell, Cell) else MARKS.get("".join(lines)[:1], PLAIN)[1]
        # A card repeats the titles; its first cell is the heading.
        label = f' data-of="{safe(name)}"' if name and place else ""
        shown = [_typeset(line, style) for line in lines] if style else lines
        style = _class(f"{style} {own}".strip())
        yield f"<td{style}{label}>{'<br/>'.join(map(safe, shown))}</td>"


def _typeset(text: str, style: str) -> str:
    """A number or a sign with a true minus; among numbers a dash where there is none."""
    minus = "–" if text == "-" and style == "num" else "−"
    return f"{minus}{text[1:]}" if text.startswith("-") else text


def _class(style: str) -> str:
    return f' class="{style}"' if style else ""
