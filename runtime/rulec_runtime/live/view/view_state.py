"""What of the plant is shown on a terminal, and how keys change that."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from rulec_runtime.live.now import Now
from rulec_runtime.live.view.words import listed

View = Literal["plant", "explanation", "past", "help"]

PAGES: dict[str, View] = {"enter": "explanation", "past": "past", "help": "help"}
"""Keys that open a view, and close it."""


@dataclass(frozen=True)
class Look:
    """`selected` is the id of an episode, the first one if there is no such; `scroll` counts lines
    beyond what must be seen."""

    selected: str = ""
    view: View = "plant"
    scroll: int = 0


def place_of(look: Look, now: Now) -> int:
    """Which of the listed episodes is selected."""
    ids = [episode.id for episode in listed(now)]
    return ids.index(look.selected) if look.selected in ids else 0


def after(look: Look, key: str, now: Now, room: int) -> Look:
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


def _down(look: Look, now: Now, room: int) -> Look:
    """The next episode; behind the last one, further down."""
    ids = [episode.id for episode in listed(now)]
    at = place_of(look, now)
    if look.view == "plant" and at + 1 < len(ids):
        return replace(look, selected=ids[at + 1], scroll=0)
    return replace(look, scroll=min(look.scroll + 1, max(room, 0)))


def _up(look: Look, now: Now) -> Look:
    ids = [episode.id for episode in listed(now)]
    at = place_of(look, now)
    if look.scroll > 0 or look.view != "plant" or at == 0:
        return replace(look, scroll=max(look.scroll - 1, 0))
    return replace(look, selected=ids[at - 1])
