"""Device health as a client sees it, and that it can change nothing."""

import asyncio
import shutil
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from rulec_runtime.live.journal.device_health import DeviceHealth, Security

from tests.live.journal.events import LEAKAGE
from tests.live.sources.plant_server import certificate, free_port

DEVICES = "http://opcfoundation.org/UA/DI/"


def asked(address: str, work: Callable[[Client], Awaitable[Any]], user: str = "") -> Any:
    async def run() -> Any:
        client = Client(address, timeout=4)
        if user:
            client.set_user(user)
        async with client:
            return await work(client)

    return asyncio.run(run())


async def health_of(client: Client) -> dict[str, ua.DataValue]:
    """Per device how it is, found as any client of OPC 10000-100 finds it."""
    di = await client.get_namespace_index(DEVICES)
    found = {}
    for device in await client.get_node(ua.NodeId(5001, di)).get_children():
        interfaces = await device.get_referenced_nodes(ua.ObjectIds.HasInterface)
        if ua.NodeId(15051, di) in [node.nodeid for node in interfaces]:
            health = await device.get_child(f"{di}:DeviceHealth")
            assert await health.read_data_type() == ua.NodeId(6244, di)
            name = (await device.read_browse_name()).Name
            found[str(name)] = await health.read_data_value(raise_on_bad_status=False)
    return found


def values(found: dict[str, ua.DataValue]) -> dict[str, int | None]:
    return {name: None if v.Value is None else v.Value.Value for name, v in found.items()}


@pytest.fixture(scope="module")
def server() -> Iterator[DeviceHealth]:
    started = DeviceHealth("abc", ["A", "B", "C"], free_port())
    yield started
    started.close()


def test_health_of_plant_and_modules(server: DeviceHealth) -> None:
    first = asked(server.address, health_of)
    assert all(not v.StatusCode.is_good() for v in first.values())
    server.show([LEAKAGE, replace(LEAKAGE, id="2", status="M")])
    found = asked(server.address, health_of)
    assert values(found) == {"abc": 3, "A": 3, "B": 0, "C": 0}
    assert all(v.StatusCode.is_good() for v in found.values())
    stuck = replace(LEAKAGE, id="3", kind="sensor", module="B", status="C")
    blind = replace(LEAKAGE, id="4", kind="unknown", module="", status="F")
    over = replace(LEAKAGE, id="5", module="C", active=False)
    server.show([LEAKAGE, stuck, blind, over], usable=False)
    found = asked(server.address, health_of)
    assert values(found) == {"abc": 1, "A": 3, "B": 2, "C": 0}
    assert all(v.StatusCode.name == "UncertainLastUsableValue" for v in found.values())


async def changed(client: Client) -> list[str]:
    """What came of each try to change something."""
    di = await client.get_namespace_index(DEVICES)
    devices = client.get_node(ua.NodeId(5001, di))
    health = await (await devices.get_children())[1].get_child(f"{di}:DeviceHealth")
    normal = ua.DataValue(ua.Variant(0, ua.VariantType.Int32))
    outcomes = []
    for work in (
        health.write_value(normal),
        health.write_attribute(ua.AttributeIds.AccessLevel, normal),
        health.set_writable(),
        devices.add_object(2, "mine"),
        health.delete(),
        client.nodes.server.call_method("0:GetMonitoredItems", 1),
    ):
        try:
            await work
            outcomes.append("done")
        except ua.UaError as error:
            outcomes.append(type(error).__name__)
    return outcomes


@pytest.mark.parametrize("user", ["", "admin"])
def test_clients_change_nothing(server: DeviceHealth, user: str) -> None:
    server.show([LEAKAGE])
    try:
        outcomes = asked(server.address, changed, user)
    except ua.UaStatusCodeError as error:
        outcomes = [type(error).__name__] if user else ["let in"]  # no name is taken
    assert set(outcomes) <= {"BadUserAccessDenied", "BadIdentityTokenRejected"}, outcomes
    assert values(asked(server.address, health_of)) == {"abc": 3, "A": 3, "B": 0, "C": 0}


def test_signed_and_encrypted_for_those_it_trusts(tmp_path: Path) -> None:
    for name in ("server", "client", "stranger"):
        asyncio.run(certificate(tmp_path, name, f"urn:{name}"))
    trusted = tmp_path / "trusted"
    trusted.mkdir()
    shutil.copy(tmp_path / "client.der", trusted)
    security = Security(tmp_path / "server.der", tmp_path / "server.pem", trusted)
    server = DeviceHealth("abc", ["A"], free_port(), security=security)
    server.show([LEAKAGE])

    async def by(name: str | None) -> dict[str, ua.DataValue]:
        client = Client(server.address, timeout=2)
        if name is not None:
            client.application_uri = f"urn:{name}"
            await client.set_security(
                SecurityPolicyBasic256Sha256,
                tmp_path / f"{name}.der",
                tmp_path / f"{name}.pem",
                server_certificate=security.certificate,
                mode=ua.MessageSecurityMode.SignAndEncrypt,
            )
        async with client:
            return await health_of(client)

    try:
        assert values(asyncio.run(by("client"))) == {"abc": 3, "A": 3}
        for name in ("stranger", None):
            with pytest.raises((ua.UaError, OSError, asyncio.TimeoutError)):
                asyncio.run(by(name))
    finally:
        server.close()
