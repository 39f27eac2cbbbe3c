"""Single keys from a terminal, without waiting for a line."""

from __future__ import annotations

import atexit
import contextlib
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Iterator
from typing import Any, Self

NAMES = {
    "\x1b[A": "up",
    "\x1bOA": "up",
    "k": "up",
    "\x1b[B": "down",
    "\x1bOB": "down",
    "j": "down",
    "\r": "enter",
    "\n": "enter",
    "a": "acknowledge",
    "p": "past",
    "q": "quit",
    "?": "help",
    "h": "help",
    "\x1b": "back",
}
"""Names of the sequences that a terminal sends."""


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
        self._rest = ""

    def __enter__(self) -> Self:
        self._file = self._terminal()
        if self._file is None:
            return self
        try:
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
        try:
            ready = select.select([self._file], [], [], seconds)[0]
            text = os.read(self._file, 256) if ready else None
        except (OSError, ValueError):
            text = b""
        if text == b"":  # the terminal is gone
            self.restore()
            return []
        # A single escape is the key itself.
        return list(self._names((text or b"").decode("ascii", "ignore"), last=text is None))

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
        if file is None:
            with contextlib.suppress(OSError):
                file = os.open("/dev/tty", os.O_RDONLY | os.O_CLOEXEC)
                self._own = True
        if file is None:
            return None
        with contextlib.suppress(OSError):
            if os.isatty(file) and (self._given is not None or os.tcgetpgrp(file) == os.getpgrp()):
                return file
        return None

    def _names(self, text: str, last: bool) -> Iterator[str]:
        """Names of keys in the input; a partial sequence waits for its end."""
        self._rest += text
        while self._rest:
            part = next((k for k in NAMES if len(k) > 1 and self._rest.startswith(k)), None)
            if part is None and not last and self._rest in ("\x1b", "\x1b[", "\x1bO"):
                return
            if part is None:
                part = _foreign(self._rest) or self._rest[0]
            self._rest = self._rest[len(part) :]
            if part in NAMES:
                yield NAMES[part]


def _foreign(text: str) -> str:
    """A leading sequence of an unused key, whose letters are not keys themselves."""
    if text[:2] not in ("\x1b[", "\x1bO"):
        return ""
    end = next((i for i, c in enumerate(text[2:], 3) if "@" <= c <= "~"), len(text))
    return text[:end]
