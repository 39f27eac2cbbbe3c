"""Events and status at a real broker; TLS to one that nobody vouches for."""

import asyncio
import json
import ssl
from collections.abc import Iterator
from pathlib import Path
from queue import Queue
from typing import Any

import pytest
from paho.mqtt import client as paho
from rulec_runtime.live.journal.mqtt_out import MqttOut
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.sources.open import open_source

from tests.conftest import compiled
from tests.live.journal.events import event_in, story
from tests.live.journal.own_broker import OwnBroker
from tests.live.sources.plant_server import certificate, free_port
from tests.live.sources.taking import Taken
from tests.live.test_watch import until


@pytest.fixture
def broker() -> Iterator[OwnBroker]:
    made = OwnBroker()
    yield made
    made.stop()


def listening(
    port: int, topics: str = "rulec/#"
) -> tuple[paho.Client, Queue[tuple[str, dict[str, Any]]]]:
    heard: Queue[tuple[str, dict[str, Any]]] = Queue()
    ready: Queue[None] = Queue()
    client = paho.Client(paho.CallbackAPIVersion.VERSION2)
    client.on_message = lambda _c, _d, m: heard.put((m.topic, json.loads(m.payload)))
    client.on_subscribe = lambda *_: ready.put(None)
    client.connect("127.0.0.1", port)
    client.subscribe(topics, qos=1)
    client.loop_start()
    ready.get(timeout=5)
    return client, heard


def test_events_and_status(broker: OwnBroker) -> None:
    sink = MqttOut(f"mqtt://127.0.0.1:{broker.port}", "abc")
    client, heard = listening(broker.port)
    until(lambda: sink.sessions)
    sink.commit("abc", story()[:2], None, dated=True)
    sink.commit("abc", story(), None, dated=True)
    got = [heard.get(timeout=5) for _ in story()]
    assert [topic for topic, _ in got] == ["rulec/abc/events"] * 4
    assert [event_in(record) for _, record in got] == story()
    sink.show("S", 1, 1.7e9, dated=True)
    topic, status = heard.get(timeout=5)
    assert topic == "rulec/abc/status"
    assert (status["status"], status["date"]) == ("S", "2023-11-14T22:13:20+00:00")
    sink.close()
    assert heard.get(timeout=5)[1]["status"] == "unknown"
    client.loop_stop()
    late, messages = listening(broker.port)  # the status is retained
    assert messages.get(timeout=5)[1]["status"] == "unknown"
    late.loop_stop()


def test_an_event_that_the_connection_lost_is_sent_again(
    broker: OwnBroker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was lost between the look at the connection and the sending."""
    sink = MqttOut(f"mqtt://127.0.0.1:{broker.port}", "abc")
    client, heard = listening(broker.port)
    until(lambda: sink.sessions)
    lost = paho.MQTTMessageInfo(1)
    lost.rc = paho.MQTT_ERR_NO_CONN
    with monkeypatch.context() as patch:
        patch.setattr(sink._client, "publish", lambda *_, **__: lost)
        with pytest.raises(JournalTrouble, match="does not confirm"):
            sink.commit("abc", story(), None, dated=True)
    sink.commit("abc", story(), None, dated=True)
    assert [event_in(heard.get(timeout=5)[1]) for _ in story()] == story()
    sink.close()
    client.loop_stop()


def test_what_cannot_be_used() -> None:
    """A password would travel readable; without a broker it is trouble, as long as it lasts."""
    hosts = ("mqtt://", "mqtt://ann:secret@host", "mqtt://h:99999", "mqtt://[")
    for url in ("x", "http://host", "ws://x", "wss://x", *hosts):
        with pytest.raises(JournalRefused, match="named mqtt://HOST:PORT") as refusal:
            MqttOut(url, "abc")
        assert "secret" not in str(refusal.value)
    for plant in ("", "a/b", "#", "+"):
        with pytest.raises(JournalRefused, match="MQTT topic"):
            MqttOut("mqtt://host", plant)
    with pytest.raises(JournalRefused, match="would travel readable"):
        MqttOut("mqtt://10.0.0.1", "abc", user="ann", password="secret")
    sink = MqttOut(f"mqtt://127.0.0.1:{free_port()}", "abc")
    sink.commit("abc", (), None, dated=True)
    with pytest.raises(JournalTrouble, match="no connection"):
        sink.commit("abc", story(), None, dated=True)
    with pytest.raises(JournalTrouble, match="no connection"):
        sink.show("ok", 0, None, dated=True)
    sink.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two authorities that vouch for themselves at localhost."""
    made = tmp_path_factory.mktemp("tls")
    for name in ("right", "wrong"):
        asyncio.run(certificate(made, name, "urn:broker"))
        text = ssl.DER_cert_to_PEM_cert((made / f"{name}.der").read_bytes())
        (made / f"{name}.crt").write_text(text)
    return made


@pytest.fixture(scope="module")
def tls_broker(folder: Path) -> Iterator[OwnBroker]:
    made = OwnBroker(folder / "right.crt")
    yield made
    made.stop()


def opened(address: str, folder: Path, ca: str) -> Taken:
    file = folder / "map.yaml"
    security = f"security: {{ca: {ca}.crt}}\n" if ca else ""
    file.write_text(f"{security}signals: {{A.dp: t/dp}}\n", encoding="utf-8")
    return Taken(open_source(f"mqtts://{address}", compiled("abc"), file))


def test_a_source_reads_from_the_right_broker_alone(tls_broker: OwnBroker, folder: Path) -> None:
    port = tls_broker.port
    taken = opened(f"localhost:{port}", folder, "right").until(lambda t: "connected" in t.kinds())
    taken.source.close()
    for host, ca, why in (
        ("localhost", "wrong", "its certificate is not trusted: self-signed certificate; name"),
        ("localhost", "", "its certificate is not trusted: self-signed certificate; name"),
        ("127.0.0.1", "right", "certificate is not valid for '127.0.0.1'"),
    ):
        taken = opened(f"{host}:{port}", folder, ca).until(lambda t: t.kinds())
        taken.take(0.2).source.close()
        assert taken.kinds() == ["lost"]
        assert why in taken.reports[0][1]


def test_events_go_to_the_right_broker_alone(tls_broker: OwnBroker, folder: Path) -> None:
    url, said = f"mqtts://localhost:{tls_broker.port}", list[str]()
    right, wrong = (
        MqttOut(url, "abc", authorities=str(folder / f"{name}.crt"), say=said.append)
        for name in ("right", "wrong")
    )
    until(lambda: right.sessions and said)
    right.commit("abc", story(), None, dated=True)
    with pytest.raises(JournalTrouble, match="no connection"):
        wrong.commit("abc", story(), None, dated=True)
    for sink in (right, wrong):
        sink.close()
    assert (wrong.sessions, len(said)) == (0, 1)
    assert "its certificate is not trusted" in said[0]
