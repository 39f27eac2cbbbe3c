"""The live screen on a terminal; elsewhere events as lines."""

from __future__ import annotations

import contextlib
import getpass
import threading
from collections.abc import Callable, Iterator
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

from rulec_runtime.live.event_forms import line_of
from rulec_runtime.live.moment import Arrival, Now
from rulec_runtime.live.steady_clock import steady
from rulec_runtime.live.view.limits import REDRAWN, TICK
from rulec_runtime.live.view.screen import Screen, ViewState, after, place_of
from rulec_runtime.live.view.terminal_keys import Keys
from rulec_runtime.live.view.words import lead, link, listed, news, overall
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.wording import status_in_words


def who() -> str:
    """Who acknowledges here: the user who started the watch."""
    with contextlib.suppress(OSError, KeyError, ImportError):  # a container may have no user names
        return f"{getpass.getuser()}, terminal"
    return "terminal"


class LiveScreen:
    """The display of `rulec watch` on a terminal, as long as the context lasts.

    `acknowledge` takes the id of an episode and who acknowledges; the drawing thread calls it.
    `told` is the number of the last event shown before. `show` is cheap: news are drawn within
    `REDRAWN` seconds, rows alone every `TICK`, however fast they come.
    """

    def __init__(
        self,
        acknowledge: Callable[[str, str], None],
        console: Console,
        keys: Keys | None = None,
        told: int = 0,
    ) -> None:
        self._acknowledge = acknowledge
        self._console = console
        self._keys = keys or Keys()
        self._told = told
        self._state = ViewState()
        self._now: Now | None = None
        self._arrival = Arrival()
        self._changed = threading.Event()
        self._closing = threading.Event()
        self._quit = threading.Event()
        self._failure: BaseException | None = None
        self._live: Live | None = None
        self._thread: threading.Thread | None = None

    @property
    def quit(self) -> bool:
        """Whether the operator has asked to quit."""
        return self._quit.is_set()

    def __enter__(self) -> Self:
        out = self._console
        if out.is_terminal and not out.is_dumb_terminal:
            self._live = Live(
                console=out, screen=True, auto_refresh=False, vertical_overflow="crop"
            )
            self._live.start()
            self._keys.__enter__()
            self._thread = threading.Thread(target=self._run, name="screen", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._closing.set()
        try:
            if self._thread is not None:
                self._thread.join()
        finally:
            self._keys.restore()
            if self._live is not None:
                self._live.stop()
        if self._live is not None and self._now is not None:
            self._console.print(closing_line(self._now), soft_wrap=True)
        if error[0] is None:
            self._raise()

    def show(self, now: Now) -> None:
        """Show the present state of the plant."""
        self._raise()
        self._arrival.saw(now.rows, steady())
        before, self._now = self._now, now
        if self._live is not None:
            if before is None or news(now) != news(before):
                self._changed.set()
            return
        for line in event_lines(now, self._told):
            self._console.print(line, soft_wrap=True)
        self._told = max([self._told, *(event.number for event in now.past)])

    @property
    def failed(self) -> bool:
        """Whether the drawing thread has failed; `show` raises its error."""
        return self._failure is not None

    def _raise(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _run(self) -> None:
        drawn = 0.0
        try:
            while not self._closing.is_set():
                pressed = self._keys.take(REDRAWN)
                for key in pressed:
                    self._press(key)
                due = self._changed.is_set() or steady() - drawn >= TICK
                if pressed or due:
                    self._changed.clear()
                    picture = self._picture()
                    if picture is not None and self._live is not None:
                        self._live.update(picture, refresh=True)
                    drawn = steady()
        except BaseException as error:  # raised by `show`, in the main thread
            self._failure = error

    def _press(self, key: str) -> None:
        if key == "quit":
            self._quit.set()
            return
        picture = self._picture()
        if picture is None:
            return
        now = picture.now
        if key == "acknowledge" and now.active:
            self._acknowledge(listed(now)[place_of(self._state, now)].id, who())
        self._state = after(self._state, key, now, picture.room(self._console))

    def _picture(self) -> Screen | None:
        if self._now is None:
            return None
        width, height = self._console.size
        age = self._arrival.age(steady())
        return Screen(self._now, self._state, width, height, age, self._keys.there)


def event_lines(now: Now, last: int) -> Iterator[Text]:
    """Events after number `last`, oldest first."""
    new = [event for event in reversed(now.past) if event.number > last]
    if new and last and new[0].number > last + 1:
        yield styled("[dim]{} events in between stand in the journal[/]", new[0].number - last - 1)
    for event in new:
        yield line_of(event, now.calendar)


def closing_line(now: Now) -> Text:
    """The state at the end of the display."""
    first = f": {lead(now)}" if now.active else ""
    return styled("{}{}; {}", status_in_words(*overall(now)), first, link(now)[1])
