"""`rulec watch` as a process that is started, killed, interrupted."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from rulec_runtime.live.episode import Event

from tests.conftest import SOURCES, compiled
from tests.soak import score


def heed_interrupts() -> None:
    """Whoever runs us in the background has interrupts ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Watch:
    """Watches of plant abc one after the other, with the same options, in a folder of their own."""

    def __init__(
        self,
        folder: Path,
        *options: str,
        journal: str = "journal.db",
        shown: int | None = None,
    ) -> None:
        """`shown` is a terminal to speak to instead of a file."""
        rules = folder / "abc.ruleset.json"
        if not rules.exists():
            rules.write_text(compiled("abc").to_json(), encoding="utf-8")
        command = (sys.executable, "-m", "rulec_runtime", "watch", rules.name)
        self._command = [*command, *options, *(("--journal", journal) if journal else ())]
        self._folder, self._journal, self._shown = folder, folder / journal, shown
        self._said = folder / f"{Path(journal).name or 'watch'}.said"
        self._process: subprocess.Popen[bytes] | None = None
        self.lives = 0

    def start(self, *more: str) -> None:
        environment = {**os.environ, "PYTHONPATH": SOURCES, "OMP_NUM_THREADS": "1"}
        with self._said.open("ab") as said:
            self._process = subprocess.Popen(
                [*self._command, *more],
                cwd=self._folder,
                env={**environment, "TERM": "xterm", "COLUMNS": "80"},
                stdin=subprocess.DEVNULL,
                stdout=said if self._shown is None else self._shown,
                stderr=subprocess.STDOUT,
                preexec_fn=heed_interrupts,
                start_new_session=self._shown is not None,
            )
        self.lives += 1

    @property
    def runs(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        """As when the power fails."""
        self._end(signal.SIGKILL, 10)

    def interrupt(self) -> int:
        """As by Ctrl-C; the exit code."""
        return self._end(signal.SIGINT, 60)

    def ended(self, seconds: float = 120.0) -> int:
        """The exit code, when it ends by itself."""
        assert self._process is not None
        return self._process.wait(seconds)

    def _end(self, how: signal.Signals, seconds: float) -> int:
        assert self._process is not None
        self._process.send_signal(how)
        return self._process.wait(seconds)

    @property
    def rows(self) -> int:
        return score.rows_of(self._journal)[0]

    @property
    def events(self) -> list[Event]:
        return score.events_of(self._journal)

    @property
    def said(self) -> str:
        """All that it wrote on the terminal."""
        return self._said.read_bytes().decode("utf-8", "replace")
