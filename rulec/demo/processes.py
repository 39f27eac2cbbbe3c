"""Processes of the live demo: the servers and the watch."""

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
    """The servers of all modules, in a process of their own."""

    def __init__(self, process: Process) -> None:
        self._process = process
        self._messages: Queue[Mapping[str, Any]] = Queue()
        Thread(target=self._listen, name="servers", daemon=True).start()

    def wait_for(self, what: str, seconds: float, watching: Process | None = None) -> Any:
        """The content of their next message; None after `seconds` without one, or if the watch ends
        before. Raises `SourceRefused` if the servers end."""
        until = time.monotonic() + seconds
        while time.monotonic() < until and (watching is None or watching.poll() is None):
            try:
                message = self._messages.get(timeout=limits.LOOK)
            except Empty:
                continue
            if what not in message:
                raise SourceRefused("the servers of the demo ended; is there no loopback?")
            return message[what]
        return None

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._messages.put(json.loads(line))
        self._messages.put({})


@contextmanager
def servers(recording: Path, step: float) -> Iterator[Servers]:
    """Servers that play a recording, a row every `step` s, as soon as a client has subscribed."""
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
    """`rulec watch` in a folder, on our terminal; interrupted at the end as by Ctrl-C."""
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
    """Write the node of each signal: ``M.x`` is ``ns=2;s=x`` of the server of M. JSON is YAML."""
    data = {
        "interval": step,
        "servers": {module: {"endpoint": endpoint} for module, endpoint in endpoints.items()},
        "signals": {name: f"ns=2;s={name.partition('.')[2]}" for name in signals},
    }
    write_text(target, json.dumps(data, indent=1) + "\n")
