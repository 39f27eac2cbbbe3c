"""Open the source of the option `--source`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Source
from rulec_runtime.live.sources.growing_file import GrowingFile
from rulec_runtime.live.sources.map import MQTT, OPCUA, Kind, SourceMap, read_map
from rulec_runtime.live.sources.remarks import SourceRefused, extra
from rulec_runtime.live.sources.table_stream import StandardInput


def open_source(
    text: str,
    ruleset: Ruleset,
    map_path: Path | None = None,
    resume: Mapping[str, Any] | None = None,
) -> Source:
    """Open a growing file, ``-`` for standard input, or an endpoint such as
    ``opc.tcp://host:4840``, ``mqtt://host`` or ``mqtts://host``; ``opcua`` or ``mqtt`` alone stand
    for the endpoint in the map.

    `resume` is the `position` of an earlier growing file. Raises `RecordingRefused`, or its
    subclass `SourceRefused`, with a message for the operator.
    """
    scheme = text.partition("://")[0] if "://" in text else text
    if scheme in ("opc.tcp", "opcua"):
        extra("asyncua", "opcua")
        from rulec_runtime.live.sources.opcua import OpcUa

        return OpcUa(_map(text, OPCUA, ruleset, map_path), ruleset)
    if scheme in ("mqtt", "mqtts"):
        extra("paho.mqtt.client", "mqtt")
        from rulec_runtime.live.sources.mqtt import Mqtt

        return Mqtt(_map(text, MQTT, ruleset, map_path), ruleset)
    if "://" in text:
        raise SourceRefused(
            f"'{text[:60]}' is no source; write a file, -, opc.tcp://..., mqtt://... or mqtts://..."
        )
    if map_path is not None:
        raise SourceRefused(f"{map_path}: a file needs no map; its columns have titles")
    if text == "-":
        return StandardInput(ruleset)
    return GrowingFile(Path(text), ruleset, resume if resume and "inode" in resume else None)


def _map(text: str, kind: Kind, ruleset: Ruleset, path: Path | None) -> SourceMap:
    if path is None:
        raise SourceRefused(
            f"{text}: a map says which signal is which {kind.address}; name it with --map"
        )
    return read_map(path, kind, ruleset, text if "://" in text else "")
