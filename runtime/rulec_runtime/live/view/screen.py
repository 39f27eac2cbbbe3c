"""The plant on a terminal: status and connection above, keys below, between them what is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.segment import Segment
from rich.style import Style

from rulec_runtime.live.now import Now
from rulec_runtime.live.view import blocks
from rulec_runtime.live.view.words import listed
from rulec_runtime.output.terminal import shown, styled

Line = list[Segment]
View = Literal["plant", "explanation", "past", "help"]

PAGES: dict[str, View] = {"enter": "explanation", "past": "past", "help": "help"}
"""Keys that open a view, and close it."""


@dataclass(frozen=True)
class ViewState:
    """`selected` is the id of an episode, the first one if there is no such; `scroll` counts lines
    beyond what must be seen."""

    selected: str = ""
    view: View = "plant"
    scroll: int = 0


KEYS = {
    "plant": "↑↓ select  ⏎ explain  a acknowledge  p past events  ? help  q quit",
    "explanation": "↑↓ scroll  ⏎ back  a acknowledge  q quit",
    "past": "↑↓ scroll  p back  q quit",
    "help": "? back  q quit",
}
"""The foot of each view."""


@dataclass(frozen=True)
class Screen:
    """A picture of `width` by `height` cells, never more; `age` is how long ago the last row came,
    s; without `keys` the foot names none."""

    now: Now
    look: ViewState
    width: int
    height: int
    age: float | None = None
    keys: bool = True

    def room(self, console: Console) -> int:
        """How many lines there are to scroll."""
        head, body, seen = self._parts(console, console.options)
        return max(len(body) - self._first(seen, head) - self._space(head), 0)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        head, body, seen = self._parts(console, options)
        space = self._space(head)
        top = min(self._first(seen, head) + self.look.scroll, max(len(body) - space, 0))
        part = body[top : top + space]
        left = len(body) - top - space
        if left > 0:
            part[-1:] = self._lines(console, options, styled("[dim]  ↓ {} more lines[/]", left + 1))
        part += [[Segment(" " * self.width)]] * (space - len(part))
        keys = KEYS[self.look.view] if self.keys else "ctrl-c ends"
        foot = self._lines(console, options, styled("[dim]{}[/]", keys))[:1]
        lines = [*head, *part, *foot][: self.height]
        for i, line in enumerate(lines):
            yield from line
            if i + 1 < len(lines):
                yield Segment.line()

    def _parts(
        self, console: Console, options: ConsoleOptions
    ) -> tuple[list[Line], list[Line], tuple[int, int]]:
        """Lines of the head and of the body, and which of the latter must be seen."""
        head = [
            line
            for part in blocks.head(self.now, self.age, self.width)
            for line in self._lines(console, options, part)
        ]
        head = [*head[: max(self.height - 2, 1)], [Segment("─" * self.width, Style(dim=True))]]
        body, seen = self._laid_out(console, options, whole=True)
        if len(body) > self._space(head):
            body, seen = self._laid_out(console, options, whole=False)
        return head, body, seen

    def _laid_out(
        self, console: Console, options: ConsoleOptions, whole: bool
    ) -> tuple[list[Line], tuple[int, int]]:
        body: list[Line] = []
        seen = (0, 0)
        selected = place_of(self.look, self.now)
        for place, block in self._body(selected, whole):
            lines = self._lines(console, options, block)
            if place == selected:
                seen = (len(body), len(body) + len(lines))
            body += lines
        return body, seen

    def _body(self, selected: int, whole: bool) -> Iterator[tuple[int, RenderableType]]:
        """Blocks; with those of an episode its place among them, else -1."""
        if self.look.view == "explanation" and self.now.active:
            yield -1, blocks.explanation_of(self.now, selected)
        elif self.look.view == "past":
            yield -1, blocks.past(self.now)
        elif self.look.view == "help":
            yield -1, blocks.help_text()
        else:
            yield from blocks.plant(self.now, selected, self.width, whole)

    def _lines(
        self, console: Console, options: ConsoleOptions, block: RenderableType
    ) -> list[Line]:
        """Lines of full width. What is not shown as written is replaced before widths count."""
        wide = options.update(width=self.width, height=None)
        lines = [
            [segment._replace(text=shown(segment.text)) for segment in line if not segment.control]
            for line in console.render_lines(block, wide, pad=False)
        ]
        return [Segment.adjust_line_length(line, self.width) for line in lines]

    def _space(self, head: list[Line]) -> int:
        return max(self.height - len(head) - 1, 1)

    def _first(self, seen: tuple[int, int], head: list[Line]) -> int:
        """First line of the body, so that what is selected can be seen."""
        space = self._space(head) - 1
        return min(max(seen[1] - space, 0), seen[0])


def place_of(look: ViewState, now: Now) -> int:
    """Which of the listed episodes is selected."""
    ids = [episode.id for episode in listed(now)]
    return ids.index(look.selected) if look.selected in ids else 0


def after(look: ViewState, key: str, now: Now, room: int) -> ViewState:
    """The look after a key; `room` is how many lines there are to scroll."""
    if key == "back":
        return replace(look, view="plant", scroll=0)
    if key in PAGES:
        opened = PAGES[key]
        if opened == "explanation" and not now.active:
            return look
        return replace(look, view="plant" if look.view == opened else opened, scroll=0)
    if key == "down":
        return _down(look, now, room)
    if key == "up":
        return _up(look, now)
    return look


def _down(look: ViewState, now: Now, room: int) -> ViewState:
    """The next episode; behind the last one, further down."""
    ids = [episode.id for episode in listed(now)]
    at = place_of(look, now)
    if look.view == "plant" and at + 1 < len(ids):
        return replace(look, selected=ids[at + 1], scroll=0)
    return replace(look, scroll=min(look.scroll + 1, max(room, 0)))


def _up(look: ViewState, now: Now) -> ViewState:
    ids = [episode.id for episode in listed(now)]
    at = place_of(look, now)
    if look.scroll > 0 or look.view != "plant" or at == 0:
        return replace(look, scroll=max(look.scroll - 1, 0))
    return replace(look, selected=ids[at - 1])
