"""TLS to a broker: a certificate that nobody vouches for is refused, and told as that."""

from __future__ import annotations

import ipaddress
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.journal.mqtt_out import MqttOut
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.sources.refused import SourceRefused

from tests.conftest import compiled
from tests.live.journal.events import story
from tests.live.journal.test_mqtt_out import OwnBroker
from tests.live.sources.taking import Taken


def certificate(file: Path, address: str = "127.0.0.1") -> Path:
    """A certificate that vouches for itself, with its key beside it."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, file.stem)])
    now = datetime.now(UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(address))]), False
        )
        .sign(key, hashes.SHA256())
    )
    file.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    file.with_suffix(".key").write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return file


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("tls")
    certificate(made / "right.pem")
    certificate(made / "wrong.pem")
    certificate(made / "elsewhere.pem", "10.0.0.1")
    return made


@pytest.fixture(scope="module")
def broker(folder: Path) -> Iterator[OwnBroker]:
    made = OwnBroker(folder / "right.pem")
    yield made
    made.stop()


def opened(port: int, folder: Path, ca: str) -> Taken:
    file = folder / f"{port}-{ca}.yaml"
    security = f"security: {{ca: {ca}.pem}}\n" if ca else ""
    file.write_text(f"{security}signals: {{A.dp: t/dp}}\n", encoding="utf-8")
    rules: Ruleset = compiled("abc")
    return Taken(open_source(f"mqtts://127.0.0.1:{port}", rules, file))


def test_a_source_reads_from_the_right_broker_alone(broker: OwnBroker, folder: Path) -> None:
    taken = opened(broker.port, folder, "right").until(lambda t: "connected" in t.kinds())
    taken.source.close()
    for ca in ("wrong", ""):
        taken = opened(broker.port, folder, ca).until(lambda t: t.kinds())
        time.sleep(0.3)
        taken.take().source.close()
        assert taken.kinds() == ["lost"]
        assert "its certificate is not trusted: self-signed certificate; name" in taken.told[0][1]


def test_a_certificate_of_another_address_is_refused(folder: Path) -> None:
    broker = OwnBroker(folder / "elsewhere.pem")
    taken = opened(broker.port, folder, "elsewhere").until(lambda t: t.kinds())
    taken.source.close()
    broker.stop()
    assert taken.kinds() == ["lost"]
    assert "certificate is not valid for '127.0.0.1'" in taken.told[0][1]


def test_events_go_to_the_right_broker_alone(broker: OwnBroker, folder: Path) -> None:
    url, said = f"mqtts://127.0.0.1:{broker.port}", list[str]()
    sinks = {
        name: MqttOut(url, "abc", authorities=str(folder / f"{name}.pem"), say=said.append)
        for name in ("right", "wrong")
    }
    ends = time.monotonic() + 10
    while not (sinks["right"].sessions and said) and time.monotonic() < ends:
        time.sleep(0.02)
    sinks["right"].commit("abc", story(), None, dated=True)
    with pytest.raises(JournalTrouble, match="no connection"):
        sinks["wrong"].commit("abc", story(), None, dated=True)
    for sink in sinks.values():
        sink.close()
    assert (sinks["wrong"].sessions, len(said)) == (0, 1)
    assert "its certificate is not trusted" in said[0]


def test_a_password_does_not_travel_readable_and_web_sockets_are_none(folder: Path) -> None:
    with pytest.raises(JournalRefused, match="would travel readable"):
        MqttOut("mqtt://10.0.0.1", "abc", user="ann", password="secret")
    for url in ("ws://x", "wss://x"):
        with pytest.raises(SourceRefused, match="is no source"):
            open_source(url, compiled("abc"), folder / "none.yaml")
        with pytest.raises(JournalRefused, match="named mqtt://HOST:PORT"):
            MqttOut(url, "abc")
