"""Events and status at a real broker."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Iterator
from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any

import pytest
from amqtt.broker import Broker
from paho.mqtt import client as paho
from rulec_runtime.live.journal.mqtt_out import MqttOut
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble

from tests.live.journal.events import event_in, story
from tests.live.sources.plant_server import free_port


class OwnBroker:
    """A broker on loopback that can be stopped and started; with TLS for a certificate, whose key
    stands beside it."""

    def __init__(self, certificate: Path | None = None) -> None:
        self._certificate = certificate
        logging.getLogger("amqtt").setLevel(logging.CRITICAL + 1)
        logging.getLogger("transitions").setLevel(logging.CRITICAL + 1)
        self.port = free_port()
        self._loop = asyncio.new_event_loop()
        Thread(target=self._loop.run_forever, daemon=True).start()
        self.start()

    def start(self) -> None:
        listener: dict[str, Any] = {"type": "tcp", "bind": f"127.0.0.1:{self.port}"}
        if self._certificate is not None:
            key = str(self._certificate.with_suffix(".key"))
            listener |= {"ssl": True, "certfile": str(self._certificate), "keyfile": key}
        plugins: dict[str, Any] = {
            "amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}
        }

        async def begun() -> None:
            self._broker = Broker({"listeners": {"default": listener}, "plugins": plugins})
            await self._broker.start()

        asyncio.run_coroutine_threadsafe(begun(), self._loop).result(10)

    def stop(self) -> None:
        asyncio.run_coroutine_threadsafe(self._broker.shutdown(), self._loop).result(10)


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
    _until_sent(sink, story()[:2])
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
    late, told = listening(broker.port)  # the status is retained
    assert told.get(timeout=5)[1]["status"] == "unknown"
    late.loop_stop()


def test_without_a_broker_it_is_trouble() -> None:
    sink = MqttOut(f"mqtt://127.0.0.1:{free_port()}", "abc")
    sink.commit("abc", (), None, dated=True)
    with pytest.raises(JournalTrouble, match="no connection"):
        sink.commit("abc", story(), None, dated=True)
    with pytest.raises(JournalTrouble, match="no connection"):
        sink.show("ok", 0, None, dated=True)
    sink.close()


def test_what_cannot_be_used() -> None:
    for url in (
        "x",
        "http://host",
        "mqtt://",
        "mqtt://ann:secret@host",
        "mqtt://h:99999",
        "mqtt://[",
    ):
        with pytest.raises(JournalRefused, match="named mqtt://HOST:PORT") as told:
            MqttOut(url, "abc")
        assert "secret" not in str(told.value)
    for plant in ("", "a/b", "#", "+"):
        with pytest.raises(JournalRefused, match="MQTT topic"):
            MqttOut("mqtt://host", plant)


def _until_sent(sink: MqttOut, events: list[Any]) -> None:
    ends = time.monotonic() + 10
    while True:
        try:
            return sink.commit("abc", events, None, dated=True)
        except JournalTrouble:
            assert time.monotonic() < ends
            time.sleep(0.02)
