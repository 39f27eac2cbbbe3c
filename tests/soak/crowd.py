"""Connections to the page that ask nothing, or slowly, by the hundred: others are answered."""

from __future__ import annotations

import socket
import time
import urllib.request
from pathlib import Path
from threading import Event, Thread
from typing import Any

from tests.live.sources.plant_server import free_port
from tests.soak import score
from tests.soak.plant import Logger, course
from tests.soak.watching import Watch

CROWD = 150
SOON = 2.0  # s within which a page is to be there


def page(folder: Path, times: int) -> dict[str, Any]:
    """A hundred and fifty connections that send a byte now and then, and come again."""
    port, what = free_port(), course(folder, int(10 * (times + 30)))
    watch = Watch(folder, "--source", "log.csv", "--page", str(port))
    over, answered = Event(), 0
    with Logger(folder / "log.csv", what, 0.1):
        time.sleep(1.0)
        watch.start()
        while not _answers(port):
            time.sleep(0.2)
        crowd = Thread(target=_crowd, args=(port, over))
        crowd.start()
        for _ in range(times):
            time.sleep(1.0)
            answered += _answers(port)
        over.set()
        crowd.join()
    code = watch.interrupt()
    return {
        "tried": times,
        "survived": answered if code == 0 else 0,
        "lost": times - answered,
        **score.bad_output(watch.out + watch.err),
    }


def _answers(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/now.json", timeout=SOON) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


def _crowd(port: int, over: Event) -> None:
    """Connections that send a request byte by byte; one that is closed is made anew."""
    slow: list[socket.socket | None] = [None] * CROWD
    while not over.wait(0.05):
        for i, one in enumerate(slow):
            try:
                slow[i] = one or socket.create_connection(("127.0.0.1", port), SOON)
                slow[i].sendall(b"G")  # type: ignore[union-attr]
            except OSError:
                slow[i] = None
