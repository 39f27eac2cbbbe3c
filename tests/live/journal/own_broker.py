"""A broker on loopback in a process of its own, which is killed and started again like a real one.

Inside the process of the tests its orderly shutdown can wait for a client for ever.
"""

import asyncio
import logging
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from amqtt.broker import Broker

from tests.live.sources.plant_server import PATIENCE, free_port


class OwnBroker:
    """With TLS for a certificate, whose key stands beside it."""

    def __init__(self, certificate: Path | None = None) -> None:
        self.port = free_port()
        self._command = [sys.executable, "-m", __name__, str(self.port)]
        self._command += [str(certificate)] if certificate else []
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(self._command)
        end = time.monotonic() + PATIENCE
        while True:
            try:
                return socket.create_connection(("127.0.0.1", self.port), 1).close()
            except OSError:
                assert self._process.poll() is None, "the broker ended"
                assert time.monotonic() < end, "the broker does not listen"
                time.sleep(0.02)

    def stop(self) -> None:
        self._process.kill()
        self._process.wait()


async def serve(port: str, certificate: str = "") -> None:
    listener: dict[str, Any] = {"type": "tcp", "bind": f"127.0.0.1:{port}"}
    if certificate:
        key = str(Path(certificate).with_suffix(".pem"))
        listener |= {"ssl": True, "certfile": certificate, "keyfile": key}
    plugins = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
    await Broker({"listeners": {"default": listener}, "plugins": plugins}).start()


if __name__ == "__main__":
    logging.disable()
    loop = asyncio.new_event_loop()
    loop.run_until_complete(serve(*sys.argv[1:]))
    loop.run_forever()
