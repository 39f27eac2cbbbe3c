"""Sinks of a watch that save nothing: an MQTT broker, an OPC UA server."""

from __future__ import annotations

import argparse
import os
from contextlib import ExitStack
from pathlib import Path

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.journal.outbox import Outbox, Sink, spill_beside
from rulec_runtime.live.journal.refused import JournalRefused, needs
from rulec_runtime.live.journal.sinks import HealthSink, MqttSink, WatchSink
from rulec_runtime.output.terminal import say_aside
from rulec_runtime.report.text import counted

CERTIFICATES = ("own.der", "own.pem", "trusted")
"""Of the device health server: its certificate, its key, and a folder of trusted certificates."""


def sinks_of(
    options: argparse.Namespace, ruleset: Ruleset, folder: Path | None, stack: ExitStack
) -> list[WatchSink]:
    """The sinks that the options name; `folder` is where events may wait."""
    sinks: list[WatchSink] = []
    if options.mqtt:
        sinks.append(_mqtt(options, ruleset.plant, folder, stack))
    elif options.mqtt_ca:
        raise JournalRefused("--mqtt-ca needs --mqtt URL")
    if options.device_health:
        sinks.append(_device_health(options, ruleset, stack))
    elif options.device_health_certificates:
        raise JournalRefused("--device-health-certificates needs --device-health [HOST:]PORT")
    return sinks


def _mqtt(
    options: argparse.Namespace, plant: str, folder: Path | None, stack: ExitStack
) -> WatchSink:
    needs("paho", "mqtt")
    from rulec_runtime.live.journal.mqtt_out import MqttOut

    broker = MqttOut(
        options.mqtt,
        plant,
        user=os.environ.get("RULEC_MQTT_USER"),
        password=os.environ.get("RULEC_MQTT_PASSWORD"),
        authorities=options.mqtt_ca,
        say=say_aside,
    )
    stack.callback(broker.close)
    outbox = waiting_in(folder, "mqtt", broker, plant)
    stack.callback(close, outbox, [])
    return MqttSink(broker, outbox, say_aside)


def _device_health(options: argparse.Namespace, ruleset: Ruleset, stack: ExitStack) -> WatchSink:
    """An OPC UA server at ``PORT`` of loopback or at ``HOST:PORT``."""
    needs("asyncua", "opcua")
    from rulec_runtime.live.journal.device_health import DeviceHealth, Security

    host, port = host_and_port("--device-health", options.device_health.removeprefix("opc.tcp://"))
    security = None
    if options.device_health_certificates:
        folder = Path(options.device_health_certificates)
        files = [folder / name for name in CERTIFICATES]
        for file in files:
            if not file.exists():
                raise JournalRefused(
                    f"{file}: there is no such file or folder; --device-health-certificates FOLDER "
                    f"holds {', '.join(CERTIFICATES[:2])} and the folder {CERTIFICATES[2]}"
                )
        security = Security(*files)
    server = DeviceHealth(ruleset.plant, tuple(ruleset.modules), port, host=host, security=security)
    stack.callback(server.close)
    return HealthSink(server)


def host_and_port(option: str, text: str) -> tuple[str, int]:
    """Host and port of ``PORT``, at loopback, or ``HOST:PORT``. Raises `JournalRefused`."""
    host, _, port = text.rstrip("/").rpartition(":")
    if not port.isdecimal() or int(port) > limits.LAST_PORT:
        raise JournalRefused(f"{option} {text[:60]}: write PORT or HOST:PORT, such as 8080")
    return host.strip("[]") or "127.0.0.1", int(port)


def waiting_in(folder: Path | None, name: str, sink: Sink, plant: str) -> Outbox:
    """The started outbox of a sink, which first writes what an earlier process has left in the
    folder; without a folder events wait in memory alone."""
    file = None if folder is None else spill_beside(folder / name, plant)
    outbox = Outbox(sink, plant, say_aside, file=file)
    outbox.start()
    return outbox


def close(outbox: Outbox, unwritten: list[str]) -> None:
    """Write what waits as far as possible; report what is left, also in `unwritten`."""
    left = outbox.close()
    if not left:
        return
    text = f"{outbox.place}: {counted(left, 'event')} could not be written"
    file = outbox.file
    if file is not None and file.exists():
        text += f"; what waits stands in {file} and is written at the next start"
    else:
        text += " and is kept nowhere else"
    say_aside(text)
    unwritten.append(text)
