"""`python -m rulec.demo.servers RECORDING.csv SECONDS`: an OPC UA server per module plays a
recording again and again, a row every so many seconds.

Prints one JSON object per line: the endpoints of the servers, the time of the first row, s since
1970, and that of the first end of the recording. Ends with its standard input. The servers listen
only on loopback.
"""

import asyncio
import csv
import json
import logging
import re
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any

from asyncua import Server, ua
from rulec_runtime.output.terminal import write_machine_text

from rulec.demo import limits
from rulec.demo.played_recording import free_port

TITLE = re.compile(r"(?P<module>[^.]+)\.(?P<reading>.+) \[(?P<unit>.+)\]")


async def main(recording: Path, step: float) -> None:
    """Serve, wait for a subscription to every server, play until our input ends."""
    with recording.open(encoding="utf-8", newline="") as file:
        titles, *rows = csv.reader(file)
    places = {k: found for k, title in enumerate(titles) if (found := TITLE.fullmatch(title))}
    modules = list(dict.fromkeys(found["module"] for found in places.values()))
    servers = {module: await _server(module) for module in modules}
    nodes = {}
    for k, found in places.items():
        server, _ = servers[found["module"]]
        nodes[k] = await _node(server, found["reading"], found["unit"], rows[0][k])
    for server, _ in servers.values():
        await server.start()
    _tell(servers={module: endpoint for module, (_, endpoint) in servers.items()})
    over = asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    playing = _play([server for server, _ in servers.values()], nodes, rows, step)
    work = {over, asyncio.ensure_future(playing)}
    done, left = await asyncio.wait(work, return_when=asyncio.FIRST_COMPLETED)
    for task in left:
        task.cancel()
    for task in done:
        task.result()
    for server, _ in servers.values():
        await server.stop()


async def _server(module: str) -> tuple[Server, str]:
    """A server that is not started yet, and its endpoint."""
    endpoint = f"opc.tcp://127.0.0.1:{free_port()}"
    server = Server()
    await server.init()
    server.set_endpoint(endpoint)
    server.set_server_name(f"module {module}")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    await server.register_namespace("urn:rulec:demo")
    return server, endpoint


async def _node(server: Server, reading: str, unit: str, first: str) -> Any:
    """A variable ``ns=2;s=READING`` with its unit."""
    node = await server.nodes.objects.add_variable(
        ua.NodeId(reading, 2), ua.QualifiedName(reading, 2), float(first)
    )
    stated = ua.EUInformation(DisplayName=ua.LocalizedText(unit))
    await node.add_property(0, "EngineeringUnits", stated)
    return node


async def _play(
    servers: Sequence[Server], nodes: Mapping[int, Any], rows: Sequence[Sequence[str]], step: float
) -> None:
    """Write row after row, each with its due time, until cancelled."""
    while not all(server.iserver.subscription_service.subscriptions for server in servers):
        await asyncio.sleep(step)
    began = time.time() + step
    for k in count():
        if k == len(rows):
            # The recording starts again: constant readings would look like broken sensors.
            asyncio.get_running_loop().call_later(
                limits.LAST_ROWS, lambda: _tell(ended=time.time())
            )
        due = began + k * step
        await asyncio.sleep(max(due - time.time(), 0.0))
        stamp = datetime.fromtimestamp(due, UTC)
        for place, node in nodes.items():
            value = ua.Variant(float(rows[k % len(rows)][place]), ua.VariantType.Double)
            await node.write_value(ua.DataValue(value, SourceTimestamp=stamp))


def _tell(**what: object) -> None:
    write_machine_text(json.dumps(what) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started us ends our input
    asyncio.run(main(Path(sys.argv[1]), float(sys.argv[2])))
