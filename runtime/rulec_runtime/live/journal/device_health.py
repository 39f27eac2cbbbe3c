"""An OPC UA server for the health of each module: `IDeviceHealthType` of OPC 10000-100.

Clients can read and subscribe. All requests to write, to call or to add nodes are refused.
Connections from other computers must be signed and encrypted.
"""

import asyncio
import logging
from collections.abc import Coroutine, Iterable, Sequence
from concurrent.futures import TimeoutError as Late
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from threading import Thread
from typing import Any

from asyncua import Server, ua
from asyncua.common.connection import TransportLimits
from asyncua.crypto.permission_rules import USER_TYPES, User, UserRole
from asyncua.crypto.truststore import TrustStore
from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions

from rulec_runtime.live.episode import Episode
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.network import is_loopback
from rulec_runtime.output.open_file import bytes_of
from rulec_runtime.output.terminal import one_line
from rulec_runtime.report.wording import STATUS

HEALTH = {"ok": 0, "F": 1, "C": 2, "S": 3, "M": 4}
"""Letter of NE 107 to DeviceHealthEnumeration. Source: OPC 10000-100, 4.5.4."""

_NAMES = ("NORMAL", "FAILURE", "CHECK_FUNCTION", "OFF_SPEC", "MAINTENANCE_REQUIRED")
_DEVICES = "http://opcfoundation.org/UA/DI/"
_DEVICE_SET, _ENUMERATION, _STRINGS, _INTERFACE, _HEALTH = 5001, 6244, 6450, 15051, 15052
"""Nodes of that namespace. Source: its NodeSet, version 1.05."""


@dataclass(frozen=True)
class Security:
    """Certificate and key files of the server, and the folder of trusted client certificates."""

    certificate: Path
    key: Path
    trusted: Path


class DeviceHealth:
    """The server, in its own thread; `DeviceSet` holds an object for the plant and one for each
    module. Raises `JournalRefused` if it cannot start."""

    def __init__(
        self,
        plant: str,
        modules: Sequence[str],
        port: int,
        *,
        host: str = "127.0.0.1",
        security: Security | None = None,
    ) -> None:
        if security is None and not is_loopback(host):
            raise JournalRefused(
                f"device health at {host}: beyond this computer it needs a certificate, a key and "
                "a folder of trusted ones"
            )
        logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)  # clients' mistakes are theirs
        self.address = f"opc.tcp://{host}:{port}"
        self._plant, self._modules, self._security = plant, tuple(dict.fromkeys(modules)), security
        self._nodes: dict[str, tuple[Any, Any]] = {}
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._loop.run_forever, name="device health", daemon=True)
        self._thread.start()
        try:
            self._wait(self._start(), limits.STARTING)
        except BaseException as error:
            self._end()
            if isinstance(error, Exception):
                reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
                raise JournalRefused(f"device health at {self.address}: {reason}") from None
            raise

    def show(self, active: Iterable[Episode], usable: bool = True) -> None:
        """Show active episodes; `usable` is False while no rows come. Raises `JournalTrouble`."""
        try:
            self._wait(self._show(tuple(active), usable))
        except (Late, ua.UaError, OSError) as error:
            raise JournalTrouble(f"{self.address}: {type(error).__name__}") from None

    def close(self) -> None:
        """Stop the server."""
        with suppress(Late, ua.UaError, OSError):  # else the thread ends with the process
            self._wait(self._server.stop())
        self._end()

    def _wait(self, work: Coroutine[Any, Any, None], seconds: float = limits.ANSWER) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result(seconds)

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(limits.ANSWER)

    async def _start(self) -> None:
        self._server = server = Server(user_manager=_Readers())
        server.limits = TransportLimits(
            max_recv_buffer=65535,
            max_send_buffer=65535,
            max_chunk_count=limits.LARGEST_REQUEST // 65535 + 1,
            max_message_size=limits.LARGEST_REQUEST,
        )
        await self._secure(server)
        await server.init()
        server.set_endpoint(self.address)
        server.set_server_name(f"rulec: {self._plant}")
        devices = await server.register_namespace(_DEVICES)
        own = await server.register_namespace(f"urn:rulec:{self._plant}")
        interface = await _device_types(server, devices)
        folder = await server.nodes.objects.add_object(
            ua.NodeId(_DEVICE_SET, devices), ua.QualifiedName("DeviceSet", devices)
        )
        for kind, name in (("plant", self._plant), *(("module", m) for m in self._modules)):
            node = ua.NodeId(f"{kind}:{name}", own)
            thing = await folder.add_object(node, ua.QualifiedName(name, own))
            await thing.add_reference(interface, ua.ObjectIds.HasInterface, True, False)
            health = await _add_health(
                thing, ua.NodeId(f"{kind}:{name}.DeviceHealth", own), devices
            )
            text = await thing.add_variable(
                ua.NodeId(f"{kind}:{name}.Message", own), ua.QualifiedName("Message", own), ""
            )
            self._nodes["" if kind == "plant" else name] = (health, text)
            waiting = ua.StatusCode(ua.StatusCodes.BadWaitingForInitialData)
            await health.write_value(ua.DataValue(StatusCode=waiting))
        await server.start()

    async def _secure(self, server: Any) -> None:
        policies = [ua.SecurityPolicyType.NoSecurity]
        if self._security is not None:
            policies = [
                ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
                ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
            ]
            await server.load_certificate(*_content(self._security.certificate))
            content, form = _content(self._security.key)
            await server.load_private_key(content, None, form)
            store = TrustStore([self._security.trusted], [])
            await store.load()
            options = CertificateValidatorOptions.TRUSTED_VALIDATION
            options |= CertificateValidatorOptions.PEER_CLIENT
            server.set_certificate_validator(CertificateValidator(options, store))
        server.set_security_policy(policies, permission_ruleset=_ReadOnly())
        server.set_identity_tokens([ua.AnonymousIdentityToken])

    async def _show(self, active: tuple[Episode, ...], usable: bool) -> None:
        code = ua.StatusCodes.Good if usable else ua.StatusCodes.UncertainLastUsableValue
        for module, (health, text) in self._nodes.items():
            mine = [e for e in active if e.active and module in ("", e.module)]
            worst = next((s for s in STATUS if any(e.status == s for e in mine)), "ok")
            message = "; ".join(one_line(e.text) for e in mine if e.status == worst)
            for node, value in (
                (health, ua.Variant(HEALTH[worst], ua.VariantType.Int32)),
                (text, ua.Variant(message, ua.VariantType.String)),
            ):
                now = datetime.now(UTC)
                await node.write_value(
                    ua.DataValue(value, ua.StatusCode(code), SourceTimestamp=now)
                )


class _Readers:
    """All clients are plain users; asyncua's own manager makes anyone named admin an admin."""

    def get_user(self, *_: Any, **__: Any) -> Any:
        return User(role=UserRole.User)


class _ReadOnly:
    def __init__(self) -> None:
        changes = {
            ua.ObjectIds.WriteRequest_Encoding_DefaultBinary,
            ua.ObjectIds.CallRequest_Encoding_DefaultBinary,
        }
        self._allowed = {ua.NodeId(kind) for kind in USER_TYPES if kind not in changes}

    def check_validity(self, user: Any, kind: Any, body: Any) -> bool:
        return kind in self._allowed


async def _device_types(server: Any, devices: int) -> Any:
    """Add the types of OPC 10000-100 that are used here; returns `IDeviceHealthType`."""
    kind = await server.nodes.enum_data_type.add_data_type(
        ua.NodeId(_ENUMERATION, devices), ua.QualifiedName("DeviceHealthEnumeration", devices)
    )
    await kind.add_property(
        ua.NodeId(_STRINGS, devices),
        ua.QualifiedName("EnumStrings", 0),
        [ua.LocalizedText(name) for name in _NAMES],
    )
    base = server.get_node(ua.NodeId(ua.ObjectIds.BaseInterfaceType))
    interface = await base.add_object_type(
        ua.NodeId(_INTERFACE, devices), ua.QualifiedName("IDeviceHealthType", devices)
    )
    health = await _add_health(interface, ua.NodeId(_HEALTH, devices), devices)
    await health.set_modelling_rule(False)
    return interface


async def _add_health(parent: Any, node: ua.NodeId, devices: int) -> Any:
    return await parent.add_variable(
        node,
        ua.QualifiedName("DeviceHealth", devices),
        ua.Variant(HEALTH["ok"], ua.VariantType.Int32),
        datatype=ua.NodeId(_ENUMERATION, devices),
    )


def _content(file: Path) -> tuple[bytes, str]:
    content = bytes_of(file, limits.LARGEST_CERTIFICATE)
    return content, "pem" if content.lstrip().startswith(b"-----BEGIN") else "der"
