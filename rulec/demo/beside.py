"""Processes of the live demo: the servers, and the watch beside them."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from typing import Any

from rulec_runtime.live.sources.refused import SourceRefused
from rulec_runtime.output.write_file import write_text

from rulec.demo import limits

Process = subprocess.Popen[Any]


class Servers:
    """Servers of all modules in a process of its own."""

    def __init__(self, process: Process) -> None:
        self._process = process
        self._told: Queue[Mapping[str, Any]] = Queue()
        Thread(target=self._listen, name="servers", daemon=True).start()

    def told(self, what: str, seconds: float, beside: Process | None = None) -> Any:
        """What they tell next; None if they tell nothing for so long, or if the process `beside`
        ends before. Raises `SourceRefused` if they end."""
        until = time.monotonic() + seconds
        while time.monotonic() < until and (beside is None or beside.poll() is None):
            try:
                found = self._told.get(timeout=limits.LOOK)
            except Empty:
                continue
            if what not in found:
                raise SourceRefused("the servers of the demo ended; is there no loopback?")
            return found[what]
        return None

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._told.put(json.loads(line))
        self._told.put({})


@contextmanager
def servers(recording: Path, step: float) -> Iterator[Servers]:
    """Servers that play a recording, a row every `step` s, once they are subscribed to."""
    process = subprocess.Popen(
        [sys.executable, "-m", "rulec.demo.servers", str(recording), str(step)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield Servers(process)
    finally:
        assert process.stdin is not None
        process.stdin.close()
        _ended(process)


@contextmanager
def watch(folder: Path, options: Sequence[str]) -> Iterator[Process]:
    """`rulec watch` in a folder, on our terminal; at the end it is interrupted as by Ctrl-C."""
    process = subprocess.Popen([sys.executable, "-m", "rulec", "watch", *options], cwd=folder)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate() if sys.platform == "win32" else process.send_signal(signal.SIGINT)
        _ended(process)


def _ended(process: Process) -> None:
    try:
        process.wait(limits.ENDING)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def write_map(
    target: Path, endpoints: Mapping[str, str], signals: Sequence[str], step: float
) -> None:
    """Which signal is which node: ``M.x`` is ``ns=2;s=x`` of the server of M. JSON is YAML."""
    data = {
        "interval": step,
        "servers": {module: {"endpoint": endpoint} for module, endpoint in endpoints.items()},
        "signals": {name: f"ns=2;s={name.partition('.')[2]}" for name in signals},
    }
    write_text(target, json.dumps(data, indent=1) + "\n")
