"""`python -m tests.soak.served opcua|mqtt PORT COURSE.json`: a plant that a process serves.

Row k of the course is due at its start plus k steps, whoever serves it: a server that was killed
goes on where the plant is by now. Prints "up" when it can be reached.
"""

import asyncio
import json
import logging
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
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


def write_play(path: Path, course: Course, start: float, step: float) -> None:
    """What is played from when on."""
    play = {**asdict(course), "start": start, "step": step}
    path.write_text(json.dumps(play), encoding="utf-8")


def due(play: dict[str, Any]) -> Iterator[tuple[float, dict[str, float]]]:
    """Rows that are due from now on, with their times; at the end the last one."""
    names = [title.partition(" ")[0] for title in play["titles"]]
    k = int((time.time() - play["start"]) / play["step"])
    k = min(max(k, 0), len(play["rows"]) - 1)
    while k < len(play["rows"]):
        at = play["start"] + k * play["step"]
        time.sleep(max(at - time.time(), 0.0))
        yield at, dict(zip(names, map(float, play["rows"][k]), strict=True))
        k += 1


def opcua(port: int, play: dict[str, Any]) -> None:
    """A node ``ns=2;s=SIGNAL`` per signal."""
    _, values = next(due({**play, "start": min(play["start"], time.time())}))
    server = PlantServer(units_of(play["titles"]), port, values=values)
    print("up", flush=True)
    for at, row in due(play):
        for name, value in row.items():
            server.write(name, value, stamp=datetime.fromtimestamp(at, UTC))


def mqtt(port: int, play: dict[str, Any]) -> None:
    """A broker, and a client of it that publishes each row as a message with all signals."""
    loop = asyncio.new_event_loop()
    loop.run_until_complete(serve(str(port)))
    Thread(target=loop.run_forever, daemon=True).start()
    client = paho.Client(CallbackAPIVersion.VERSION2)
    client.connect_async(HOST, port)
    client.loop_start()
    print("up", flush=True)
    for at, row in due(play):
        client.publish("plant", json.dumps({"time": at, **row}))


def units_of(titles: Sequence[str]) -> dict[str, str]:
    """Units of signals by their names."""
    return {title.partition(" ")[0]: title.removesuffix("]").split(" [")[1] for title in titles}


def maps(kind: str, course: Course, port: int, step: float) -> str:
    """The map of either source; JSON is YAML."""
    units = units_of(course.titles)
    if kind == "opcua":
        signals: dict[str, Any] = {name: f"ns=2;s={name}" for name in units}
        scheme = "opc.tcp"
    else:
        signals = {n: {"topic": "plant", "name": n, "unit": u} for n, u in units.items()}
        scheme = "mqtt"
    data = {"endpoint": f"{scheme}://{HOST}:{port}", "interval": step, "signals": signals}
    return json.dumps(data, indent=1)


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    kind, port, file = sys.argv[1:]
    work = {"opcua": opcua, "mqtt": mqtt}[kind]
    work(int(port), json.loads(Path(file).read_text(encoding="utf-8")))
    Event().wait()
