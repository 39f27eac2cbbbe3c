"""The plant on a terminal: status and connection above, findings below, keys at the foot."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.segment import Segment
from rich.style import Style

from rulec_runtime.live.moment import Now
from rulec_runtime.live.view import blocks
from rulec_runtime.live.view.words import listed
from rulec_runtime.output.terminal import shown, styled

Line = list[Segment]
View = Literal["plant", "explanation"]


@dataclass(frozen=True)
class ViewState:
    """`selected` is the id of an episode; an unknown id selects the first one. `scroll` counts
    lines beyond the selection."""

    selected: str = ""
    view: View = "plant"
    scroll: int = 0


KEYS = {
    "plant": "↑↓ select  ⏎ explain  a acknowledge  q quit",
    "explanation": "↑↓ scroll  ⏎ back  a acknowledge  q quit",
}
"""The foot of each view."""


@dataclass(frozen=True)
class Screen:
    """A picture of at most `width` by `height` cells; `age` is that of the last row, s; without
    `keys` the foot names none."""

    now: Now
    state: ViewState
    width: int
    height: int
    age: float | None = None
    keys: bool = True

    def room(self, console: Console) -> int:
        """Number of lines to scroll."""
        head, body, selection = self._parts(console, console.options)
        return max(len(body) - self._first(selection, head) - self._space(head), 0)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        head, body, selection = self._parts(console, options)
        space = self._space(head)
        top = min(self._first(selection, head) + self.state.scroll, max(len(body) - space, 0))
        part = body[top : top + space]
        left = len(body) - top - space
        if left > 0:
            part[-1:] = self._lines(console, options, styled("[dim]  ↓ {} more lines[/]", left + 1))
        part += [[Segment(" " * self.width)]] * (space - len(part))
        keys = KEYS[self.state.view] if self.keys else "ctrl-c ends"
        foot = self._lines(console, options, styled("[dim]{}[/]", keys))[:1]
        lines = [*head, *part, *foot][: self.height]
        for i, line in enumerate(lines):
            yield from line
            if i + 1 < len(lines):
                yield Segment.line()

    def _parts(
        self, console: Console, options: ConsoleOptions
    ) -> tuple[list[Line], list[Line], tuple[int, int]]:
        """Lines of the head and of the body, and the range of the selected ones in the body."""
        head = [
            line
            for part in blocks.head(self.now, self.age, self.width)
            for line in self._lines(console, options, part)
        ]
        head = [*head[: max(self.height - 2, 1)], [Segment("─" * self.width, Style(dim=True))]]
        body: list[Line] = []
        selection, selected = (0, 0), place_of(self.state, self.now)
        for place, block in self._body(selected):
            lines = self._lines(console, options, block)
            if place == selected:
                selection = (len(body), len(body) + len(lines))
            body += lines
        return head, body, selection

    def _body(self, selected: int) -> Iterator[tuple[int, RenderableType]]:
        """Blocks, each with the index of its episode or -1."""
        if self.state.view == "explanation" and self.now.active:
            yield -1, blocks.explanation_of(self.now, selected)
        else:
            yield from blocks.plant(self.now, selected, self.width)

    def _lines(
        self, console: Console, options: ConsoleOptions, block: RenderableType
    ) -> list[Line]:
        """Lines of full width. Hidden characters are replaced before widths are measured."""
        wide = options.update(width=self.width, height=None)
        lines = [
            [segment._replace(text=shown(segment.text)) for segment in line if not segment.control]
            for line in console.render_lines(block, wide, pad=False)
        ]
        return [Segment.adjust_line_length(line, self.width) for line in lines]

    def _space(self, head: list[Line]) -> int:
        return max(self.height - len(head) - 1, 1)

    def _first(self, selection: tuple[int, int], head: list[Line]) -> int:
        """First line of the body that makes the selection visible."""
        space = self._space(head) - 1
        return min(max(selection[1] - space, 0), selection[0])


def place_of(state: ViewState, now: Now) -> int:
    """Index of the selected episode among the listed ones."""
    ids = [episode.id for episode in listed(now)]
    return ids.index(state.selected) if state.selected in ids else 0


def after(state: ViewState, key: str, now: Now, room: int) -> ViewState:
    """The view state after a key; `room` is the number of lines to scroll."""
    ids, at = [episode.id for episode in listed(now)], place_of(state, now)
    if key == "back":
        return replace(state, view="plant", scroll=0)
    if key == "enter":
        opened: View = "explanation" if state.view == "plant" and now.active else "plant"
        return replace(state, view=opened, scroll=0)
    if key == "down":
        if state.view == "plant" and at + 1 < len(ids):
            return replace(state, selected=ids[at + 1], scroll=0)
        return replace(state, scroll=min(state.scroll + 1, max(room, 0)))
    if key == "up":
        if state.scroll > 0 or state.view != "plant" or at == 0:
            return replace(state, scroll=max(state.scroll - 1, 0))
        return replace(state, selected=ids[at - 1])
    return state
