"""Publish events and the retained status of a plant to an MQTT broker.

Topics are `rulec/PLANT/events` and `rulec/PLANT/status`, or another path before the plant. The
broker confirms each event (QoS 1); a subscriber recognizes duplicates by their number. When the
connection breaks, the broker itself publishes an unknown status (its last will).
"""

import json
import ssl
import sys
from collections.abc import Callable, Sequence
from typing import Any
from urllib.parse import urlsplit

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.event_records import form_for, iso, json_line
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.limits import KEEP_ALIVE
from rulec_runtime.live.network import is_loopback, tls_reason
from rulec_runtime.output.open_file import opened
from rulec_runtime.output.terminal import machine_text

_PORTS = {"mqtt": 1883, "mqtts": 8883}
_UNKNOWN = json.dumps({"status": "unknown", "text": "nobody watches"})


class MqttOut:
    """A connection to ``mqtt://host:port`` or ``mqtts://host:port``, which reconnects by itself; a
    path in the URL replaces ``rulec`` in the topics.

    `say` gets a line for people if a certificate is not trusted. Raises `JournalRefused` for an
    unusable URL or plant, and for a password that would be sent in plain text.
    """

    def __init__(
        self,
        url: str,
        plant: str,
        *,
        user: str | None = None,
        password: str | None = None,
        authorities: str | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        if not plant or any(sign in plant for sign in "+#/\0"):
            raise JournalRefused(f"the plant's name {plant} cannot be part of an MQTT topic")
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port or _PORTS.get(parts.scheme)
        except ValueError:
            host = port = None
        if not host or parts.scheme not in _PORTS or port is None or parts.username is not None:
            # The text is not shown, as it may contain a password.
            raise JournalRefused(
                "an MQTT broker is named mqtt://HOST:PORT or mqtts://HOST:PORT, without a user"
            )
        before = parts.path.strip("/") or "rulec"
        if any(sign in before for sign in "+#\0") or parts.query or "#" in url:
            raise JournalRefused(f"{before} cannot be the beginning of an MQTT topic")
        if password and parts.scheme == "mqtt" and not is_loopback(host):
            raise JournalRefused(f"the password for {host} would travel readable; write mqtts://")
        self.address = f"{parts.scheme}://{host}:{port}"
        self.sessions = 0
        """Number of accepted connections; after each, the status must be published again."""
        self._say, self._distrusted = say, False
        self._topic = f"{before}/{plant}"
        self._last = 0
        self._sent: dict[int, paho.MQTTMessageInfo] = {}
        self._client = client = paho.Client(CallbackAPIVersion.VERSION2)
        client.will_set(f"{self._topic}/status", _UNKNOWN, qos=1, retain=True)
        if user is not None:
            client.username_pw_set(user, password)
        if parts.scheme == "mqtts":
            try:
                if authorities:
                    opened(authorities).close()  # refuses a pipe, for which the library would wait
                client.tls_set(ca_certs=authorities)
            except OSError as error:
                raise JournalRefused(f"{authorities}: {error.strerror or error}") from None
        client.on_connect, client.on_connect_fail = self._on_connect, self._on_connect_fail
        client.reconnect_delay_set(1, int(limits.LAST_RETRY))
        client.connect_async(host, port, KEEP_ALIVE)
        client.loop_start()

    def commit(
        self, plant: str, events: Sequence[Event], state: bytes | None, *, dated: bool
    ) -> None:
        """Send new events, without states. Raises `JournalTrouble` while the broker does not
        confirm them."""
        new = [event for event in events if event.number > self._last]
        if new and not self._client.is_connected():
            raise JournalTrouble(f"{self.address}: no connection")
        for event in new:
            sent = self._sent.get(event.number)
            if sent is None or sent.rc:
                # The client itself repeats what it took, but never confirms what it refused.
                text = json_line(form_for(event, plant, dated)).rstrip()
                topic = f"{self._topic}/events"
                self._sent[event.number] = self._client.publish(topic, text, qos=1)
        for event in new:
            self._confirmed(self._sent[event.number])
            del self._sent[event.number]
            self._last = event.number

    def show(self, status: str, active: int, time: float | None, dated: bool) -> None:
        """Publish the status: a letter of NE 107 or ``ok``, the number of active episodes, and the
        time of the last row, s. Raises `JournalTrouble`."""
        date = iso(time) if dated and time is not None else None
        text = json.dumps({"status": status, "active": active, "time": time, "date": date})
        if not self._client.is_connected():
            raise JournalTrouble(f"{self.address}: no connection")
        self._client.publish(f"{self._topic}/status", machine_text(text), qos=1, retain=True)

    def close(self) -> None:
        """Publish that nobody watches any more, and disconnect."""
        if self._client.is_connected():
            self._confirmed(self._client.publish(f"{self._topic}/status", _UNKNOWN, 1, True))
        self._client.disconnect()
        self._client.loop_stop()

    def _on_connect(self, _client: Any, _data: Any, _flags: Any, code: Any, _p: Any) -> None:
        if not code.is_failure:
            self.sessions += 1
        elif self._say is not None:
            self._say(f"{self.address}: the broker refuses: {code.getName()}")

    def _on_connect_fail(self, _client: Any, _data: Any) -> None:
        """paho passes no reason, but calls this while it handles the exception."""
        error = sys.exc_info()[1]
        if isinstance(error, ssl.SSLError) and self._say is not None and not self._distrusted:
            self._distrusted = True
            self._say(f"{self.address}: {tls_reason(error)}")

    def _confirmed(self, sent: paho.MQTTMessageInfo) -> None:
        try:
            sent.wait_for_publish(limits.ANSWER)
            if sent.is_published():
                return
        except (RuntimeError, ValueError):
            pass  # not sent yet: no connection, or the queue is full
        raise JournalTrouble(f"{self.address}: the broker does not confirm what was sent")
