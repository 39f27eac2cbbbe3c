"""Blocks of lines that make up the screen."""

from collections.abc import Iterator

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rulec_runtime.live.episode import QUIET
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.limits import BAR_ENDS
from rulec_runtime.live.view.words import (
    Bar,
    Card,
    bars_of,
    cards,
    event_words,
    latest,
    lead,
    link,
    modules,
    overall,
    unjudged,
    unseen,
)
from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.report.terminal_findings import explanation
from rulec_runtime.report.wording import COLOURS, SHOWN, STATUS, status_in_words

BAR_CELLS = 18
"""Length of the bar of a residual, in cells."""


def head(now: Now, age: float | None, width: int) -> Iterator[RenderableType]:
    """Status of the plant and of each module, and the connection."""
    letter, status = overall(now)[1], status_in_words(*overall(now))
    yield _short(width, "[bold {}]{}[/]  {}", _colour(letter), status, now.title)
    mark, words = link(now)
    style, row = "dim" if now.connected else "bold red", latest(now, age)
    source = _short(max(width - len(row) - 2, 20), "[{}]{} {}[/]", style, mark, words)
    yield Text.assemble(source, " " * (width - source.cell_len - len(row)), styled("{}", row))
    if now.remark:
        yield _short(width, "  {}", now.remark)
    parts = [
        styled("{} [{}]{}[/]", name, _colour(one), f"{STATUS[one][0]} {one}")
        for name, _, one in modules(now)
    ]
    if parts:
        line = Text("  ").join([Text("modules"), *parts])
        line.truncate(width, overflow="ellipsis")
        yield line


def plant(now: Now, selected: int, width: int) -> Iterator[tuple[int, RenderableType]]:
    """Findings, residuals, blind spots and past events, each block with the index of its episode or
    -1."""
    found = cards(now)
    if not found:
        yield -1, styled("[bold {}]{}[/]", _colour(overall(now)[1]), lead(now))
    for i, card in enumerate(found):
        if card.episode.kind == "blind" and (i == 0 or found[i - 1].episode.kind != "blind"):
            yield -1, _title("Cannot be judged now")
        yield i, _card(card, i == selected, width)
    residuals = bars_of(now)
    if residuals is not None:
        yield -1, _title(residuals.title)
        yield -1, _bars(residuals.bars)
        if residuals.smaller:
            yield -1, styled("  and {} smaller ones", residuals.smaller)
        if residuals.missing:
            yield -1, _remark(width, "not available", ", ".join(residuals.missing))
    remarks = unjudged(now)
    if remarks or unseen(now):
        yield -1, _title("Not judged")
        for text, spans in remarks[:SHOWN]:
            yield -1, _remark(width, spans, text)
        if unseen(now):
            yield -1, _remark(width, "no reading shows", ", ".join(unseen(now)))
    if now.past:
        yield -1, _title("Past events")
        yield -1, _events(now)


def explanation_of(now: Now, index: int) -> RenderableType:
    """The explanation of a finding; the details of any other episode."""
    card = cards(now)[index]
    if card.finding is not None and now.diagnosis is not None:
        return explanation(now.diagnosis, card.finding, card.since)
    parts = [styled("[bold]{}[/]", card.title), styled("{}", card.since)]
    if card.size:
        parts.append(styled("degree {}, probability {}", card.size, card.probability))
    if card.others:
        parts.append(styled("also possible: {}", card.others))
    if card.action:
        parts.append(styled("do: {}", card.action))
    if card.episode.kind == "fault":
        parts.append(styled("[dim]Its rows are no longer remembered: no explanation.[/]"))
    return Group(*parts)


def _card(card: Card, selected: bool, width: int) -> RenderableType:
    """A mark, and beside it some lines, of which the longest may wrap twice."""
    letter = card.episode.status
    pointer, symbol = ">" if selected else " ", STATUS[letter][0]
    mark = styled("{} [bold {}]{} {}[/]", pointer, _colour(letter), symbol, letter)
    style = "bold reverse" if selected else "bold"
    size = f"{card.episode.subject} {card.size}, " if card.size else ""
    rest = width - mark.cell_len - 1
    lines = [
        _short(3 * rest, f"{{}}[{style}]{{}}[/]", "" if card.acknowledged else "NEW ", card.title),
        _short(2 * rest, "{}{}", size, card.since),
    ]
    if card.episode.grows:
        lines.append(_short(3 * rest, "{}", card.episode.grows))
    if card.probability:
        others = f"; or: {card.others}" if card.others else ""
        lines.append(_short(3 * rest, "probability {}{}", card.probability, others))
    if card.action:
        lines.append(_short(3 * rest, "do: {}", card.action))
    table = Table.grid(padding=(0, 1, 0, 0))
    table.add_row(mark, Text("\n").join(lines))
    return table


def _bars(residuals: tuple[Bar, ...]) -> Table:
    table = Table(box=None, padding=(0, 1), pad_edge=False, show_header=False)
    for justify in ("left", "right", "right", "left", "left"):
        table.add_column(justify=justify, no_wrap=True)
    for bar in residuals:
        style = "bold" if bar.beyond else "dim"
        row = [styled("[{}]{}[/]", style, part) for part in (bar.value, drawn(bar), bar.words)]
        row.insert(1, styled("[dim]{}[/]", bar.threshold))
        table.add_row(styled("  [{}]{}[/]", style, bar.name), *row)
    return table


def drawn(bar: Bar) -> str:
    """A residual as a bar of text, with its threshold.

    >>> drawn(Bar("r", "", "", 0.5)), drawn(Bar("r", "", "", 9.0))
    ('███···┃···········', '██████┃██████████»')
    """
    full = round(bar.filled * BAR_CELLS)
    cells = ["█"] * full + ["·"] * (BAR_CELLS - full)
    cells[round(BAR_CELLS / BAR_ENDS)] = "┃"
    if bar.share > BAR_ENDS:
        cells[-1] = "»"
    return "".join(cells)


def _events(now: Now) -> Table:
    table = Table(box=None, padding=(0, 1), pad_edge=False, show_header=False)
    for wrapped in (False, False, False, True):
        table.add_column(no_wrap=not wrapped)
    for event in now.past[:SHOWN]:
        when, badge, what, text = event_words(now, event)
        colour = "dim" if what in QUIET else _colour(event.episode.status)
        noted = " (acknowledged)" if event.episode.id in now.acknowledged else ""
        table.add_row(
            styled("  [dim]{}[/]", when),
            styled("[{}]{}[/]", colour, badge),
            styled("{}", what),
            styled("{}[dim]{}[/]", text, noted),
        )
    return table


def _title(text: str) -> Text:
    return styled("\n[bold]{}[/]", text)


def _remark(width: int, first: str, text: str) -> Padding:
    line = one_line(styled("{}: {}", first, text).plain)
    return Padding(_short(3 * (width - 2), "{}", line), (0, 0, 0, 2))


def _short(cells: int, template: str, *data: object) -> Text:
    """At most so many cells, so that a long name cannot push a finding off the screen."""
    text = styled(template, *data)
    text.truncate(cells, overflow="ellipsis")
    return text


def _colour(letter: str) -> str:
    return COLOURS.get(letter, "default")  # nothing was judged yet
