"""The plant on a terminal: status and connection above, findings below, keys at the foot."""

from dataclasses import dataclass, replace
from typing import Literal

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
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
        _, body, first, space = self._parts(console, console.options)
        return max(len(body) - first - space, 0)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        head, body, first, space = self._parts(console, options)
        top = min(first + self.state.scroll, max(len(body) - space, 0))
        part = body[top : top + space]
        left = len(body) - top - space
        if left > 0:
            part[-1:] = self._lines(console, options, styled("[dim]  ↓ {} more lines[/]", left + 1))
        part += [[Segment(" " * self.width)]] * (space - len(part))
        keys = KEYS[self.state.view] if self.keys else "ctrl-c ends"
        foot = self._lines(console, options, styled("[dim]{}[/]", keys))[:1]
        for i, line in enumerate([*head, *part, *foot][: self.height]):
            if i:
                yield Segment.line()
            yield from line

    def _parts(
        self, console: Console, options: ConsoleOptions
    ) -> tuple[list[Line], list[Line], int, int]:
        """Lines of the head and of the body, the first line of the body that makes the selection
        visible, and the number of lines for the body."""
        above = Group(*blocks.head(self.now, self.age, self.width))
        head = self._lines(console, options, above)[: max(self.height - 2, 1)]
        head.append([Segment("─" * self.width, Style(dim=True))])
        space, first = max(self.height - len(head) - 1, 1), 0
        selected, body = selected_index(self.state, self.now), list[Line]()
        if self.state.view == "explanation" and self.now.active:
            explained = blocks.explanation_of(self.now, selected)
            return head, self._lines(console, options, explained), first, space
        for index, block in blocks.plant(self.now, selected, self.width):
            lines = self._lines(console, options, block)
            if index == selected:
                first = min(max(len(body) + len(lines) - space + 1, 0), len(body))
            body += lines
        return head, body, first, space

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


def selected_index(state: ViewState, now: Now) -> int:
    """Index of the selected episode among the listed ones."""
    ids = [episode.id for episode in listed(now)]
    return ids.index(state.selected) if state.selected in ids else 0


def after(state: ViewState, key: str, now: Now, room: int) -> ViewState:
    """The view state after a key; `room` is the number of lines to scroll."""
    ids, at = [e.id for e in listed(now)], selected_index(state, now)
    listing = state.view == "plant"
    if key == "enter" and listing and now.active:
        return replace(state, view="explanation", scroll=0)
    if key in ("enter", "back"):
        return replace(state, view="plant", scroll=0)
    if key == "down" and listing and at + 1 < len(ids):
        return replace(state, selected=ids[at + 1], scroll=0)
    if key == "up" and listing and at > 0 and state.scroll <= 0:
        return replace(state, selected=ids[at - 1])
    if key == "down":
        return replace(state, scroll=min(state.scroll + 1, max(room, 0)))
    return replace(state, scroll=max(state.scroll - 1, 0)) if key == "up" else state
