"""The live screen on a terminal, and its keys; elsewhere events as lines."""

import atexit
import contextlib
import getpass
import os
import re
import select
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from typing import Any, Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

from rulec_runtime.live.episode import line_of
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.limits import REDRAWN, TICK
from rulec_runtime.live.view.screen import Screen, ViewState, after, selected_index
from rulec_runtime.live.view.words import display_state, lead, link, listed, overall
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.wording import status_in_words

NAMES = {
    "\x1b[A": "up",
    "\x1bOA": "up",
    "\x1b[B": "down",
    "\x1bOB": "down",
    "\r": "enter",
    "\n": "enter",
    "a": "acknowledge",
    "q": "quit",
    "\x1b": "back",
}
"""Names of the sequences that a terminal sends."""

_SEQUENCE = re.compile(r"\x1b[\[O][0-?]*[@-~]|.", re.DOTALL)
"""A sequence, whose letters are no keys themselves, or a key."""


class Keys:
    """Keys of a terminal, which is restored at the end of the context.

    `file` is a descriptor; by default standard input, or the terminal of the process if rows come
    on standard input. Without a terminal, or if another process owns it, there are no keys. Ctrl-C
    interrupts; Ctrl-Z is disabled, as it would not restore the terminal.
    """

    def __init__(self, file: int | None = None) -> None:
        self._given = file
        self._file: int | None = None
        self._before: list[Any] | None = None
        self._own = False

    def __enter__(self) -> Self:
        self._file = self._terminal()
        try:
            if self._file is not None:
                self._before = termios.tcgetattr(self._file)
                atexit.register(self.restore)
                tty.setcbreak(self._file, termios.TCSANOW)
                now = termios.tcgetattr(self._file)
                now[6][termios.VSUSP] = b"\x00"
                termios.tcsetattr(self._file, termios.TCSANOW, now)
        except (termios.error, OSError):
            self.restore()
        return self

    def __exit__(self, *error: object) -> None:
        self.restore()

    @property
    def there(self) -> bool:
        """Whether there is a terminal."""
        return self._file is not None

    def take(self, seconds: float) -> list[str]:
        """Names of pressed keys, after waiting at most so many seconds."""
        if self._file is None:
            time.sleep(seconds)
            return []
        text = b""
        with contextlib.suppress(OSError, ValueError):
            if not select.select([self._file], [], [], seconds)[0]:
                return []
            text = os.read(self._file, 256)
        if not text:  # the terminal is gone
            self.restore()
        found = _SEQUENCE.findall(text.decode("ascii", "ignore"))
        return [NAMES[part] for part in found if part in NAMES]

    def restore(self) -> None:
        """Restore the terminal."""
        file, self._file = self._file, None
        if file is None:
            return
        atexit.unregister(self.restore)
        with contextlib.suppress(termios.error, OSError):
            if self._before is not None:
                termios.tcsetattr(file, termios.TCSANOW, self._before)
        if self._own:
            with contextlib.suppress(OSError):
                os.close(file)

    def _terminal(self) -> int | None:
        """Descriptor of a terminal with this process in the foreground."""
        file = self._given
        with contextlib.suppress(OSError, ValueError, AttributeError):
            if file is None and sys.stdin.isatty():
                file = sys.stdin.fileno()
        with contextlib.suppress(OSError):
            if file is None:
                file = os.open("/dev/tty", os.O_RDONLY | os.O_CLOEXEC)
                self._own = True
            if os.isatty(file) and (self._given is not None or os.tcgetpgrp(file) == os.getpgrp()):
                return file
        return None


def who() -> str:
    """Who acknowledges here: the user who started the watch."""
    with contextlib.suppress(OSError, KeyError, ImportError):  # a container may have no user names
        return f"{getpass.getuser()}, terminal"
    return "terminal"


class LiveScreen:
    """The display of `rulec watch` on a terminal, as long as the context lasts.

    `acknowledge` takes the id of an episode and who acknowledges; the drawing thread calls it.
    `reported` is the number of the last event shown before. `show` is cheap: news are drawn within
    `REDRAWN` seconds, rows alone every `TICK`, however fast they come.
    """

    def __init__(
        self,
        acknowledge: Callable[[str, str], None],
        console: Console,
        keys: Keys | None = None,
        reported: int = 0,
    ) -> None:
        self._acknowledge = acknowledge
        self._console = console
        self._keys = keys or Keys()
        self._reported = reported
        self._state = ViewState()
        self._now: Now | None = None
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
        before, self._now = self._now, now
        if self._live is not None:
            if before is None or display_state(now) != display_state(before):
                self._changed.set()
            return
        for line in event_lines(now, self._reported):
            self._console.print(line, soft_wrap=True)
        self._reported = max([self._reported, *(event.number for event in now.past)])

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
                if pressed or self._changed.is_set() or time.monotonic() - drawn >= TICK:
                    self._changed.clear()
                    if self._live is not None and (picture := self._picture()) is not None:
                        self._live.update(picture, refresh=True)
                    drawn = time.monotonic()
        except BaseException as error:  # raised by `show`, in the main thread
            self._failure = error

    def _press(self, key: str) -> None:
        if key == "quit":
            self._quit.set()
        elif (picture := self._picture()) is not None:
            now = picture.now
            if key == "acknowledge" and now.active:
                self._acknowledge(listed(now)[selected_index(self._state, now)].id, who())
            self._state = after(self._state, key, now, picture.room(self._console))

    def _picture(self) -> Screen | None:
        if self._now is None:
            return None
        width, height = self._console.size
        return Screen(self._now, self._state, width, height, self._now.age, self._keys.there)


def event_lines(now: Now, last: int) -> Iterator[Text]:
    """Events after number `last`, oldest first."""
    new = [event for event in reversed(now.past) if event.number > last]
    if new and last and new[0].number > last + 1:
        gone = new[0].number - last - 1
        text = plural(gone, "event in between stands", "events in between stand")
        yield styled("[dim]{} in the journal[/]", text)
    for event in new:
        yield line_of(event, now.calendar)


def closing_line(now: Now) -> Text:
    """The state at the end of the display."""
    first = f": {lead(now)}" if now.active else ""
    return styled("{}{}; {}", status_in_words(*overall(now)), first, link(now)[1])
