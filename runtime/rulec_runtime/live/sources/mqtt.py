"""MQTT: topics of a map, subscribed with QoS 1; nothing is published."""

from __future__ import annotations

import ssl
import sys
from collections.abc import Sequence
from threading import Event, Thread
from typing import Any
from urllib.parse import urlsplit

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.network import tls_reason
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.assembler import Assembler, usable
from rulec_runtime.live.sources.handover import Handover
from rulec_runtime.live.sources.map import Channel, SourceMap, conversion
from rulec_runtime.live.sources.mqtt_payload import BadPayload, Value, values_of
from rulec_runtime.live.sources.refused import SourceRefused
from rulec_runtime.live.sources.remarks import Remarks, notice
from rulec_runtime.live.sources.sparkplug import Heard, Sparkplug
from rulec_runtime.live.steady import Standstill, steady
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.recording_file import largest_reading


class Mqtt:
    """Rows of the topics of a broker.

    A message that holds all signals is a row; else a row ends when every signal has come, or an
    interval after its first value. paho connects again by itself.
    """

    dated = True
    ended = False

    def __init__(self, source: SourceMap, ruleset: Ruleset) -> None:
        self._source, self._remarks = source, Remarks()
        self._sparkplug = Sparkplug(source.channels)
        place_of = {c.signal.id: c.signal.id for c in source.channels}
        self._place_of = place_of | self._sparkplug.place_of
        self._hand = Handover(tuple(self._place_of))
        self._rows = Assembler(source, self._place_of, self._hand, self._remarks)
        self._by_topic: dict[str, list[Channel]] = {}
        self._scales: dict[str, tuple[float, float, float]] = {}
        for channel in source.channels:
            self._by_topic.setdefault(channel.address, []).append(channel)
            factor, offset = conversion(channel.signal, channel.unit, ruleset)
            most = largest_reading(channel.signal)
            own = (channel.scale * factor, channel.offset * factor + offset, most)
            self._scales[channel.signal.id] = own
        plain = [topic for topic in self._by_topic if not self._sparkplug.hears(topic)]
        self._topics = [*plain, *self._sparkplug.topics]
        self._newest: dict[str, float] = {}
        self._gone: float | None = None
        self._stopped = Event()
        self._client = self._connecting()
        self._client.loop_start()
        self._ticker = Thread(target=self._ticks, name="mqtt", daemon=True)
        self._ticker.start()

    def take(self, seconds: float) -> list[Rows | Notice]:
        return [] if self.ended else self._hand.take(seconds)

    def close(self) -> None:
        self.ended = True
        self._stopped.set()
        self._client.disconnect()
        self._client.loop_stop()
        self._ticker.join()

    def _connecting(self) -> paho.Client:
        server = self._source.servers[0]
        access, parts = server.access, urlsplit(server.endpoint)
        known = self._source.client
        client = paho.Client(CallbackAPIVersion.VERSION2, client_id=known, clean_session=not known)
        if parts.scheme == "mqtts":
            try:
                client.tls_set(
                    ca_certs=str(access.ca) if access.ca else None,
                    certfile=str(access.certificate) if access.certificate else None,
                    keyfile=str(access.key) if access.key else None,
                )
            except (OSError, ValueError, ssl.SSLError) as error:
                raise SourceRefused(f"{server.endpoint}: {error}; look at 'security'") from None
        if access.user:
            client.username_pw_set(access.user, access.password or None)
        client.on_connect, client.on_disconnect = self._on_connect, self._on_disconnect
        client.on_subscribe = self._on_subscribe
        client.on_connect_fail = self._on_connect_fail
        client.on_message = lambda _c, _d, message: self.receive(
            message.topic, bytes(message.payload)
        )
        client.reconnect_delay_set(1, int(limits.LAST_RETRY))
        port = parts.port or (8883 if parts.scheme == "mqtts" else 1883)
        client.connect_async(str(parts.hostname), port, limits.KEEP_ALIVE)
        return client

    def _ticks(self) -> None:
        still = Standstill()
        while not self._stopped.wait(min(self._source.interval / 4, limits.TICK)):
            if lasted := still.lasted:
                text = f"this computer stood still for {lasted:.0f} s, or its clock was set"
                told = notice("gap", steady.wall() - lasted, f"{text}; rows may be missing")
                self._hand.notices([told])
            still.moves()
            self._rows.tick()

    def _on_connect(self, client: paho.Client, _data: Any, _flags: Any, code: Any, _p: Any) -> None:
        if code.is_failure:
            self._lost(f"the broker refuses: {code.getName()}")
            return
        client.subscribe([(topic, 1) for topic in self._topics])

    def _on_subscribe(self, _c: Any, _data: Any, _id: Any, codes: Sequence[Any], _p: Any) -> None:
        """Only now does a message of a topic reach us."""
        endpoint = self._source.servers[0].endpoint
        denied = [t for t, code in zip(self._topics, codes, strict=False) if code.is_failure]
        if denied:
            text = f"{endpoint}: the broker denies the topics {', '.join(denied)}"
            self._hand.notices([notice("refused", steady.wall(), text)])
        signals = plural(len(self._scales), "signal", "signals")
        text = f"{endpoint}: {signals} of {plural(len(self._topics), 'topic', 'topics')}"
        unnamed = [c.signal for c in self._source.channels if not c.unit]
        if unnamed:
            text += f"; units of the plant are assumed for {', '.join(s.id for s in unnamed)}"
        found = [notice("connected", steady.wall(), text, still=self._rows.silent)]
        if self._gone is not None and self._rows.begun:
            text = f"{endpoint}: not connected for {steady.wall() - self._gone:.3g} s"
            found.append(notice("gap", self._gone, text))
        self._gone = None
        self._hand.notices(found)

    def _on_disconnect(self, _c: Any, _data: Any, _flags: Any, code: Any, _p: Any) -> None:
        if not self.ended:
            self._lost(f"the connection ended: {code.getName()}")

    def _on_connect_fail(self, _client: Any, _data: Any) -> None:
        """Called while paho handles what went wrong: it hands over no reason."""
        error = sys.exc_info()[1]
        if not isinstance(error, ssl.SSLError):
            self._lost("the broker does not answer")
            return
        remedy = "name its authority with 'security: {ca: FILE}'"
        self._lost(f"{tls_reason(error)}; {remedy}")

    def _lost(self, why: str) -> None:
        """Told once until the connection stands again."""
        if self._gone is None:
            self._gone = steady.wall()
            text = f"{self._source.servers[0].endpoint}: {why}"
            self._hand.notices([notice("lost", self._gone, text)])

    def receive(self, topic: str, payload: bytes) -> None:
        """A message as it came, whatever it holds."""
        binary = self._sparkplug.hears(topic) and not payload.lstrip().startswith(b"{")
        channels = self._by_topic.get(topic)
        try:
            if binary:
                self._sparkplugged(self._sparkplug.heard(topic, payload))
            elif channels is not None:
                self._found(values_of(payload, channels, self._source.time))
        except BadPayload as bad:
            # Topics of a subscription with wildcards are the sender's words, as many as it likes.
            key = topic if channels is not None else "sparkplug"
            text = f"{topic}: a message is left out: {bad}"
            self._hand.notices(self._remarks.tell("refused", (key, str(bad)), steady.wall(), text))

    def _sparkplugged(self, heard: Heard) -> None:
        for kind, key, text in heard.remarks:
            self._hand.notices(self._remarks.tell(kind, ("sparkplug", key), steady.wall(), text))
        for place in heard.gone:
            self._rows.lost(place)
        self._rows.living(heard.living)
        self._found(heard.values)

    def _found(self, found: Sequence[tuple[Channel, Value]]) -> None:
        here = steady.wall()
        values, times = {}, []
        for channel, value in found:
            time = self._time(value.stamp, here)
            if self._is_news(channel, time):
                factor, offset, most = self._scales[channel.signal.id]
                reading = usable(value.number * factor + offset, value.bad, most)
                values[channel.signal.id] = reading
                times.append(time)
        if values:
            self._rows.put({self._place_of[name] for name in values}, values, max(times))

    def _time(self, stamp: float | None, here: float) -> float:
        """The stamp, s; the time of arrival where there is none, or it is of the future, which is
        told once: a clock that runs ahead would make all late that comes after it is mended."""
        if stamp is None or stamp <= here + limits.CLOCK_APART:
            return here if stamp is None else stamp
        text = f"stamps are {stamp - here:.0f} s ahead of our clock; rows bear our time"
        self._hand.notices(self._remarks.tell("clock", "ahead", here, text))
        return here

    def _is_news(self, channel: Channel, time: float) -> bool:
        """Whether a value is later than all before; else told once."""
        signal = channel.signal.id
        before = self._newest.get(signal, -float("inf"))
        if time <= before:
            twice = time == before
            why = "it came twice" if twice else f"it is {before - time:.3g} s late"
            text, key = f"{signal}: a value is left out: {why}", (signal, twice)
            self._hand.notices(self._remarks.tell("clock", key, steady.wall(), text))
            return False
        self._newest[signal] = time
        return True
