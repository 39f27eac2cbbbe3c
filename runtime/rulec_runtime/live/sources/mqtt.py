"""MQTT: subscribes to the topics of a map with QoS 1; publishes nothing."""

import ssl
import sys
import time as clocks
from collections.abc import Hashable, Sequence
from threading import Event, Thread
from typing import Any
from urllib.parse import urlsplit

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.limits import KEEP_ALIVE
from rulec_runtime.live.network import tls_reason
from rulec_runtime.live.rows import Notice, NoticeKind, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.assembler import Assembler, Handover, usable
from rulec_runtime.live.sources.map import Channel, SourceMap
from rulec_runtime.live.sources.mqtt_payload import BadPayload, Value, values_of
from rulec_runtime.live.sources.remarks import Remarks, SourceRefused, notice
from rulec_runtime.live.sources.sparkplug import Sparkplug
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.reading_unit import conversion
from rulec_runtime.recordings.recording_file import largest_reading


class Mqtt:
    """Rows of the topics of a broker.

    A message with all signals is a row; otherwise a row ends when every signal has come, or an
    interval after its first value. paho reconnects by itself.
    """

    dated = True
    ended = False

    def __init__(self, source: SourceMap, ruleset: Ruleset) -> None:
        self._source, self._remarks = source, Remarks()
        self._sparkplug = Sparkplug(source.channels)
        sender_of = {c.signal.id: c.signal.id for c in source.channels}
        self._sender_of = sender_of | self._sparkplug.sender_of
        self._hand = Handover()
        self._rows = Assembler(source, self._sender_of, self._hand, self._remarks)
        self._by_topic: dict[str, list[Channel]] = {}
        self._scales: dict[str, tuple[float, float, float]] = {}
        for channel in source.channels:
            self._by_topic.setdefault(channel.address, []).append(channel)
            factor, offset = conversion(channel.signal, channel.unit, ruleset.units)
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
        name = self._source.client
        client = paho.Client(CallbackAPIVersion.VERSION2, client_id=name, clean_session=not name)
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
        client.connect_async(str(parts.hostname), port, KEEP_ALIVE)
        return client

    def _ticks(self) -> None:
        while not self._stopped.wait(min(self._source.interval / 4, limits.TICK)):
            self._rows.tick()

    def _on_connect(self, client: paho.Client, _data: Any, _flags: Any, code: Any, _p: Any) -> None:
        if code.is_failure:
            self._lost(f"the broker refuses: {code.getName()}")
            return
        client.subscribe([(topic, 1) for topic in self._topics])

    def _on_subscribe(self, _c: Any, _data: Any, _id: Any, codes: Sequence[Any], _p: Any) -> None:
        """Messages of the topics come only from now on."""
        endpoint = self._source.servers[0].endpoint
        denied = [t for t, code in zip(self._topics, codes, strict=False) if code.is_failure]
        if denied:
            text = f"{endpoint}: the broker denies the topics {', '.join(denied)}"
            self._hand.notices([notice("refused", clocks.time(), text)])
        signals = plural(len(self._scales), "signal", "signals")
        text = f"{endpoint}: {signals} of {plural(len(self._topics), 'topic', 'topics')}"
        unnamed = [c.signal for c in self._source.channels if not c.unit]
        if unnamed:
            text += f"; units of the plant are assumed for {', '.join(s.id for s in unnamed)}"
        found = [notice("connected", clocks.time(), text, still=self._rows.silent)]
        if self._gone is not None and self._rows.begun:
            text = f"{endpoint}: not connected for {clocks.time() - self._gone:.3g} s"
            found.append(notice("gap", self._gone, text))
        self._gone = None
        self._hand.notices(found)

    def _on_disconnect(self, _c: Any, _data: Any, _flags: Any, code: Any, _p: Any) -> None:
        if not self.ended:
            self._lost(f"the connection ended: {code.getName()}")

    def _on_connect_fail(self, _client: Any, _data: Any) -> None:
        """paho passes no reason, but calls this while it handles the exception."""
        error = sys.exc_info()[1]
        if isinstance(error, ssl.SSLError):
            self._lost(f"{tls_reason(error)}; name its authority with 'security: {{ca: FILE}}'")
        else:
            self._lost("the broker does not answer")

    def _lost(self, why: str) -> None:
        """Reported once per loss of the connection."""
        if self._gone is None:
            self._gone = clocks.time()
            text = f"{self._source.servers[0].endpoint}: {why}"
            self._hand.notices([notice("lost", self._gone, text)])

    def receive(self, topic: str, payload: bytes) -> None:
        """Take in a message with any content."""
        binary = self._sparkplug.hears(topic) and not payload.lstrip().startswith(b"{")
        channels = self._by_topic.get(topic)
        try:
            if binary:
                heard = self._sparkplug.heard(topic, payload)
                for kind, name, text in heard.remarks:
                    self._tell(kind, ("sparkplug", name), text)
                for sender in heard.gone:
                    self._rows.lost(sender)
                self._rows.living(heard.living)
                self._found(heard.values)
            elif channels is not None:
                self._found(values_of(payload, channels, self._source.time))
        except BadPayload as bad:
            # With wildcards the sender chooses the topics, so there may be any number of them.
            key = topic if channels is not None else "sparkplug"
            self._tell("refused", (key, str(bad)), f"{topic}: a message is left out: {bad}")

    def _tell(self, kind: NoticeKind, key: Hashable, text: str) -> None:
        self._hand.notices(self._remarks.tell(kind, key, clocks.time(), text))

    def _found(self, found: Sequence[tuple[Channel, Value]]) -> None:
        here = clocks.time()
        values, times = {}, []
        for channel, value in found:
            time = self._time(value.stamp, here)
            name = channel.signal.id
            if self._is_new(name, time):
                factor, offset, most = self._scales[name]
                values[name] = usable(value.number * factor + offset, value.bad, most)
                times.append(time)
        if values:
            self._rows.put({self._sender_of[name] for name in values}, values, max(times))

    def _time(self, stamp: float | None, here: float) -> float:
        """The stamp, s; the time of arrival without a stamp, or if it lies in the future, which is
        reported once: otherwise all values would be late once a fast clock is corrected."""
        if stamp is None or stamp <= here + limits.CLOCK_APART:
            return here if stamp is None else stamp
        text = f"stamps are {stamp - here:.0f} s ahead of our clock; rows bear our time"
        self._hand.notices(self._remarks.tell("clock", "ahead", here, text))
        return here

    def _is_new(self, signal: str, time: float) -> bool:
        """Whether a value is later than all before; otherwise it is reported once."""
        before = self._newest.get(signal, -float("inf"))
        if time <= before:
            twice = time == before
            why = "it came twice" if twice else f"it is {before - time:.3g} s late"
            self._tell("clock", (signal, twice), f"{signal}: a value is left out: {why}")
            return False
        self._newest[signal] = time
        return True
