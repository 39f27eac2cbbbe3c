"""The story on the terminal and as a page, which also has pictures."""

from __future__ import annotations

import re

from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text
from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.report.document import Head, document, facts, numbered, section
from rulec_runtime.report.html_findings import badge
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.tables import columns, table
from rulec_runtime.report.text import safe

from rulec.mismatch.answer.pictures import pictures_of
from rulec.mismatch.answer.story import Part, story
from rulec.mismatch.answer.wording import letter, meaning, symbol
from rulec.mismatch.result import Mismatch

_COLOURS = {"F": "red", "C": "dark_orange", "S": "yellow", "M": "blue", "ok": "green"}


def tell(out: Console, mismatch: Mismatch) -> None:
    """Print the story in brief."""
    colour = _COLOURS[letter(mismatch)]
    out.print(styled("\n[bold {}]{} {}[/]", colour, symbol(mismatch), meaning(mismatch)))
    out.print(styled("[dim]{}, {}[/]", mismatch.title, mismatch.recording))
    if mismatch.headline:
        out.print(styled("\n[bold]{}[/]", mismatch.headline))
    for part in story(mismatch, brief=True):
        out.print(styled("\n[bold]{}[/]", part.title))
        for content in (_table(part), *map(Text, part.texts), _facts(part)):
            if content is not None:
                out.print(Padding(content, (0, 0, 0, 2)))


def _table(part: Part) -> RenderableType | None:
    if not part.rows:
        return None
    shown = Table(box=None, padding=(0, 1), pad_edge=False, header_style="dim")
    for place, title in enumerate(part.titles):
        justify = "right" if title.startswith(".") else "left"
        shown.add_column(title.removeprefix("."), justify=justify, no_wrap=place > 0)  # type: ignore[arg-type]
    for row in part.rows:
        shown.add_row(*map(one_line, row))
    return shown


def _facts(part: Part) -> RenderableType | None:
    if not part.facts:
        return None
    shown = Table(box=None, show_header=False, padding=(0, 1), pad_edge=False)
    shown.add_column(style="dim", min_width=9, no_wrap=True)
    shown.add_column(overflow="fold")
    for term, lines in part.facts:
        for place, line in enumerate(lines):
            shown.add_row(one_line("" if place else term), one_line(line))
    return shown


def report(mismatch: Mismatch, subject: Subject, made: Made | None = None) -> str:
    """The page as HTML; the same comparison gives the same text.

    Parameters
    ----------
    subject : the plant as its file says, and the recording.
    made : when and by what it was made; None leaves that out.
    """
    style, parts = letter(mismatch), story(mismatch, brief=False)
    sections = [
        f'<section class="finding is-{style}"><h3>{safe(part.title)}</h3>{_html(part)}</section>'
        for part in parts
        if part.first
    ]
    if figures := "".join(numbered(pictures_of(mismatch, subject.calendar))):
        sections.append(section("Pictures", figures))
    sections += [section(safe(part.title), _html(part)) for part in parts if not part.first]
    first, more = verdict(mismatch)
    found = [name for f in mismatch.findings for name in (f.module, *f.members)]
    found += [place.module for place in mismatch.locations]
    head = Head(
        kind="Mismatch of simulation and recording",
        verdict=first,
        meaning=more,
        badge=badge(style),
        facts=tuple(subject.facts()),
        made=made,
        sketch=sketch(subject.ruleset, dict.fromkeys(found, style)),
    )
    return document(head, "".join(sections))


def _html(part: Part) -> str:
    rows = [list(map(safe, row)) for row in part.rows]
    shown = table(part.title, columns(*part.titles), rows) if rows else ""
    texts = "".join(f"<p>{safe(text)}</p>" for text in part.texts)
    more = facts(part.facts) if part.facts else ""
    return shown + texts + (more if part.first or not more else f'<div class="facts">{more}</div>')


def verdict(mismatch: Mismatch) -> tuple[str, str]:
    """The verdict in one sentence, and what must follow at once."""
    text = mismatch.headline or meaning(mismatch)
    first, *rest = re.split(r"(?<=[.])\s+(?=[A-Z])", text, maxsplit=1)
    return first.removesuffix("."), " ".join([*rest, f"{meaning(mismatch)}."])
