"""`python -m tests.soak.served opcua|mqtt PORT COURSE.json HOST`: a plant that a process serves.

Row k of the course is due at its start plus k steps, whoever serves it: a server that was killed
goes on where the plant is by now. Prints "up" when it can be reached.
"""

from __future__ import annotations

import asyncio
import json
import logging
import sys
import time
from collections.abc import AsyncIterator
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tests.soak.plant import Course, texts


def write_play(path: Path, course: Course, start: float, step: float) -> None:
    """What is played from when on."""
    play = {**asdict(course), "start": start, "step": step}
    path.write_text(json.dumps(play), encoding="utf-8")


async def due(play: dict[str, Any]) -> AsyncIterator[tuple[float, list[str]]]:
    """Rows that are due from now on, with their times."""
    k = max(int((time.time() - play["start"]) / play["step"]), 0)
    while k < len(play["rows"]):
        at = play["start"] + k * play["step"]
        await asyncio.sleep(max(at - time.time(), 0.0))
        yield at, play["rows"][k]
        k += 1


async def opcua(port: int, path: Path, host: str) -> None:
    """A node ``ns=2;s=SIGNAL`` per signal."""
    from asyncua import Server, ua

    play = json.loads(path.read_text(encoding="utf-8"))
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://{host}:{port}")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    space = await server.register_namespace("urn:plant")
    nodes = []
    k = min(max(int((time.time() - play["start"]) / play["step"]), 0), len(play["rows"]) - 1)
    for title, first in zip(play["titles"], play["rows"][k], strict=True):
        name, unit = title.removesuffix("]").split(" [")
        identity = ua.NodeId(name, space), ua.QualifiedName(name, space)
        node = await server.nodes.objects.add_variable(*identity, float(first))
        stated = ua.EUInformation(DisplayName=ua.LocalizedText(unit))
        await node.add_property(0, "EngineeringUnits", stated)
        nodes.append(node)
    await server.start()
    print("up", flush=True)
    async for at, row in due(play):
        stamp, good = datetime.fromtimestamp(at, UTC), ua.StatusCode(ua.StatusCodes.Good)
        for node, cell in zip(nodes, row, strict=True):
            value = ua.Variant(float(cell), ua.VariantType.Double)
            await node.write_value(ua.DataValue(value, good, stamp))
    await asyncio.Event().wait()


async def mqtt(port: int, path: Path, host: str) -> None:
    """A broker, and a client of it that publishes each row as a message with all signals."""
    from amqtt.broker import Broker
    from paho.mqtt import client as paho
    from paho.mqtt.enums import CallbackAPIVersion

    play = json.loads(path.read_text(encoding="utf-8"))
    plugins = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
    listener = {"type": "tcp", "bind": f"{host}:{port}"}
    await Broker({"listeners": {"default": listener}, "plugins": plugins}).start()
    client = paho.Client(CallbackAPIVersion.VERSION2)
    client.connect_async(host, port)
    client.loop_start()
    names = texts(play["titles"])
    print("up", flush=True)
    async for at, row in due(play):
        values = dict(zip(names, map(float, row), strict=True))
        client.publish("plant", json.dumps({"time": at, **values}))
    await asyncio.Event().wait()


def maps(kind: str, course: Course, host: str, port: int, step: float) -> str:
    """The map of either source; JSON is YAML."""
    units = {t.partition(" ")[0]: t.removesuffix("]").split(" [")[1] for t in course.titles}
    if kind == "opcua":
        signals: dict[str, Any] = {name: f"ns=2;s={name}" for name in units}
        scheme = "opc.tcp"
    else:
        signals = {n: {"topic": "plant", "name": n, "unit": u} for n, u in units.items()}
        scheme = "mqtt"
    data = {"endpoint": f"{scheme}://{host}:{port}", "interval": step, "signals": signals}
    return json.dumps(data, indent=1)


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    work = {"opcua": opcua, "mqtt": mqtt}[sys.argv[1]]
    asyncio.run(work(int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4]))
