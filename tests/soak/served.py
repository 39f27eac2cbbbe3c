"""`python -m tests.soak.served opcua|mqtt PORT PLAY`: a plant that a process serves.

Row k of the course is due at its start plus k steps, whoever serves it: a server that was killed
goes on where the plant is by now. Prints "up" when it can be reached.
"""

import asyncio
import json
import logging
import pickle
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from threading import Event, Thread
from typing import Any

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from tests.live.journal.own_broker import serve
from tests.live.sources.plant_server import PlantServer
from tests.soak.watching import Course

HOST = "127.0.0.1"


@dataclass(frozen=True)
class Play:
    """A course, and when its first row is due, s since 1970; `step` s from row to row."""

    course: Course
    start: float
    step: float

    @property
    def units(self) -> dict[str, str]:
        """Units of signals by their names."""
        titles = (title.removesuffix("]").partition(" [") for title in self.course.titles)
        return {name: unit for name, _, unit in titles}

    def due(self) -> Iterator[tuple[float, dict[str, float]]]:
        """Rows that are due from now on, with their times; at the end the last one."""
        last = len(self.course.rows) - 1
        first = int((time.time() - self.start) / self.step)
        for k in range(min(max(first, 0), last), last + 1):
            at = self.start + k * self.step
            time.sleep(max(at - time.time(), 0.0))
            yield at, dict(zip(self.units, self.course.rows[k], strict=True))

    def map_for(self, kind: str, port: int) -> str:
        """The map of either source; JSON is YAML."""
        if kind == "opcua":
            signals: dict[str, Any] = {name: f"ns=2;s={name}" for name in self.units}
        else:
            signals = {n: {"topic": "plant", "name": n, "unit": u} for n, u in self.units.items()}
        scheme = {"opcua": "opc.tcp", "mqtt": "mqtt"}[kind]
        endpoint = f"{scheme}://{HOST}:{port}"
        return json.dumps({"endpoint": endpoint, "interval": self.step, "signals": signals})


def opcua(port: int, play: Play) -> None:
    """A node ``ns=2;s=SIGNAL`` per signal."""
    values = dict(zip(play.units, play.course.rows[0], strict=True))
    server = PlantServer(play.units, port, values=values)
    print("up", flush=True)
    for at, row in play.due():
        for name, value in row.items():
            server.write(name, value, stamp=datetime.fromtimestamp(at, UTC))


def mqtt(port: int, play: Play) -> None:
    """A broker, and a client of it that publishes each row as a message with all signals."""
    loop = asyncio.new_event_loop()
    loop.run_until_complete(serve(str(port)))
    Thread(target=loop.run_forever, daemon=True).start()
    client = paho.Client(CallbackAPIVersion.VERSION2)
    client.connect_async(HOST, port)
    client.loop_start()
    print("up", flush=True)
    for at, row in play.due():
        client.publish("plant", json.dumps({"time": at, **row}))


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    kind, port, file = sys.argv[1:]
    work = {"opcua": opcua, "mqtt": mqtt}[kind]
    work(int(port), pickle.loads(Path(file).read_bytes()))
    Event().wait()
