"""Progress of a long command on standard error: a bar on a terminal, a line now and then in a pipe,
nothing if the command ends soon."""

import threading
import time
from typing import Self

from rich.console import Console

from rulec_runtime import limits
from rulec_runtime.output.terminal import one_line, terminal


class Progress:
    """A context manager that is called with the current activity and how much of it is done.

    Parameters
    ----------
    command : the command; lines in a pipe begin with it.
    doing : the first activity.
    console : where to show progress, instead of standard error.
    """

    def __init__(
        self, command: str, doing: str, quiet: bool = False, console: Console | None = None
    ) -> None:
        self._command, self._doing, self._quiet = command, doing, quiet
        self._console = console or terminal(aside=True)
        self._done, self._of = 0.0, 0.0
        self._begin = self._since = time.monotonic()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._show, daemon=True)

    def __call__(self, doing: str, done: float = 0.0, of: float = 0.0) -> None:
        """Set the activity, and how much of how much is done; `of` is 0 if unknown."""
        if doing != self._doing:
            self._since = time.monotonic()
        self._doing, self._done, self._of = doing, done, of

    def __enter__(self) -> Self:
        if not self._quiet:
            self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.end()

    def end(self) -> None:
        """Show nothing any more: the work is done."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()

    def line(self) -> str:
        """The activity, the time so far, and the time left.

        >>> Progress("rulec study", "judging").line()
        'rulec study: judging, 0 s so far'
        """
        share = f" {self._done:g} of {self._of:g}" if self._of else ""
        so_far = f"{_duration(time.monotonic() - self._begin)} so far"
        left = self.left()
        ahead = "" if left is None else f", about {_duration(left)} left"
        return one_line(f"{self._command}: {self._doing}{share}, {so_far}{ahead}")

    def left(self) -> float | None:
        """Seconds that the activity still takes at the speed so far; None if unknown."""
        if not 0.0 < self._done < self._of:
            return None
        return (time.monotonic() - self._since) * (self._of - self._done) / self._done

    def _show(self) -> None:
        """Runs in its own thread until the work is done."""
        if not self._console.is_terminal:
            while not self._over.wait(limits.LINE_EVERY):
                self._console.print(self.line(), soft_wrap=True)
        elif not self._over.wait(limits.SHOWN_AFTER):
            self._draw_bar()

    def _draw_bar(self) -> None:
        # Imported only for slow commands, so that the others start faster.
        from rich.progress import BarColumn, SpinnerColumn, TextColumn
        from rich.progress import Progress as Bars

        columns = SpinnerColumn(), TextColumn("{task.description}", markup=False)
        with Bars(*columns, BarColumn(20), console=self._console, transient=True) as bars:
            task = bars.add_task("", total=None)
            while True:
                text = self.line().removeprefix(f"{self._command}: ")
                bars.update(task, description=text, total=self._of or None, completed=self._done)
                if self._over.wait(limits.DRAWN_EVERY):
                    return


def _duration(seconds: float) -> str:
    """A duration for people.

    >>> _duration(8.4), _duration(100), _duration(4020)
    ('8 s', '1:40 min', '1:07 h')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60}:{whole % 60:02d} min"
    return f"{whole // 3600}:{whole % 3600 // 60:02d} h"
