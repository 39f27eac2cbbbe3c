"""`rulec watch` as a process that is started, killed, interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tests.conftest import SOURCES, compiled


def heed_interrupts() -> None:
    """Whoever runs us in the background has interrupts ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Watch:
    """Watches of plant abc one after the other, with the same options, in a folder of their own."""

    def __init__(
        self, folder: Path, *options: str, name: str = "watch", before: Sequence[str] = ()
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        rules = folder / "abc.ruleset.json"
        if not rules.exists():
            rules.write_text(compiled("abc").to_json(), encoding="utf-8")
        self._command = [
            *before,
            *(sys.executable, "-m", "rulec_runtime", "watch", rules.name),
            *options,
        ]
        self._folder, self._name = folder, name
        self._process: subprocess.Popen[bytes] | None = None
        self.lives = self.stood_still = 0

    def start(self, *more: str) -> None:
        environment = {**os.environ, "PYTHONPATH": SOURCES, "OMP_NUM_THREADS": "1"}
        with (
            (self._folder / f"{self._name}.out").open("ab") as out,
            (self._folder / f"{self._name}.err").open("ab") as err,
        ):
            self._process = subprocess.Popen(
                [*self._command, *more],
                cwd=self._folder,
                env=environment,
                stdout=out,
                stderr=err,
                preexec_fn=heed_interrupts,
            )
        self.lives += 1

    @property
    def runs(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        """As when the power fails."""
        self._end(signal.SIGKILL, 10)

    def stand_still(self, seconds: float) -> None:
        """As in a container that is frozen."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        self._process.send_signal(signal.SIGCONT)
        self.stood_still += 1

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
    def out(self) -> str:
        return self._read("out")

    @property
    def err(self) -> str:
        return self._read("err")

    def _read(self, what: str) -> str:
        data = (self._folder / f"{self._name}.{what}").read_bytes()
        return data.decode("utf-8", "replace")
