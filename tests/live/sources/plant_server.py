"""An OPC UA server on loopback, in a thread of its own, that can be killed and started again."""

import asyncio
import logging
import socket
from collections.abc import Coroutine, Mapping
from datetime import UTC, datetime
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
from asyncua import Server, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.server.uaprocessor import UaProcessor
from cryptography.x509.oid import ExtendedKeyUsageOID

UNITS = {"A.dp": "bar", "A.n": "rpm"}
VALUES: dict[str, float | str] = {"A.dp": 1.8, "A.n": 900.0, "text": "x"}
PATIENCE = 60
"""Seconds that a request may take on a loaded machine; an idle one needs a hundredth of one."""


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


class PlantServer:
    """Signals of plant abc as Double nodes ``ns=2;s=A.dp``, with engineering units.

    `namespaces` are those that it registers when it starts; the nodes are in the last of them.
    """

    def __init__(
        self,
        units: Mapping[str, str] = UNITS,
        port: int = 0,
        certified: Path | None = None,
        values: Mapping[str, float | str] = VALUES,
    ) -> None:
        logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)
        self._set_port(port or free_port())
        self._units, self._values, self._certified = units, values, certified
        self.namespaces = ["urn:plant"]
        self._loop = asyncio.new_event_loop()
        Thread(target=self._loop.run_forever, daemon=True).start()
        self.nodes: dict[str, Any] = {}
        try:
            self.start()
        except OSError:
            # Another process took the port between its choice and now.
            if port:
                raise
            self._set_port(free_port())
            self.start()

    def _set_port(self, port: int) -> None:
        self.port = port
        self.url = f"opc.tcp://127.0.0.1:{port}"

    def run(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(PATIENCE)

    def start(self) -> None:
        self.run(self._start())

    def stop(self) -> None:
        """The socket goes at once, as when the power fails."""
        self.run(self._server.stop())

    def stand_still(self) -> Event:
        """It answers nothing until the event is set; its sockets stay open."""
        moves = Event()
        self._loop.call_soon_threadsafe(moves.wait, PATIENCE)
        return moves

    def write(self, signal: str, value: Any, code: int = 0, stamp: datetime | None = None) -> None:
        kind = ua.VariantType.Double if isinstance(value, float) else None
        at = stamp or datetime.now(UTC)
        data = ua.DataValue(ua.Variant(value, kind), ua.StatusCode(code), SourceTimestamp=at)
        self.run(self.nodes[signal].write_value(data))

    def delete(self, signal: str) -> None:
        """The node is there no more."""
        self.run(self._server.delete_nodes([self.nodes[signal]]))

    def add(self, signal: str, value: Any, kind: ua.VariantType, data_type: int) -> None:
        """A further node, of a data type that it states."""
        place, stated = ua.NodeId(signal, 2), ua.NodeId(data_type)
        add = self._server.nodes.objects.add_variable
        self.nodes[signal] = self.run(add(place, signal, value, kind, stated))

    async def _start(self) -> None:
        self._server = server = Server()
        await server.init()
        server.set_endpoint(self.url)
        if self._certified:
            await server.set_application_uri("urn:server")
            await certificate(self._certified, "plant", "urn:server")
            await server.load_certificate(str(self._certified / "plant.der"))
            await server.load_private_key(str(self._certified / "plant.pem"))
            server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
        for uri in self.namespaces:
            number = await server.register_namespace(uri)
        for name, value in self._values.items():
            node = await server.nodes.objects.add_variable(
                ua.NodeId(name, number), ua.QualifiedName(name, number), value
            )
            if name in self._units:
                information = ua.EUInformation(DisplayName=ua.LocalizedText(self._units[name]))
                await node.add_property(0, "EngineeringUnits", information)
            self.nodes[name] = node
        await server.start()


async def certificate(folder: Path, name: str, uri: str) -> None:
    """A certificate NAME.der with its key NAME.pem."""
    usage = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
    key, der = folder / f"{name}.pem", folder / f"{name}.der"
    await setup_self_signed_certificate(key, der, uri, "localhost", usage, {})


def record_services(patch: pytest.MonkeyPatch) -> set[str]:
    """Names of all requests that come over the network from now on."""
    seen: set[str] = set()
    process = UaProcessor._process_message

    async def recorded(self: Any, kind: Any, *rest: Any) -> Any:
        name = ua.ObjectIdNames.get(kind.Identifier, str(kind))
        seen.add(name.removesuffix("_Encoding_DefaultBinary"))
        return await process(self, kind, *rest)

    patch.setattr(UaProcessor, "_process_message", recorded)
    return seen
