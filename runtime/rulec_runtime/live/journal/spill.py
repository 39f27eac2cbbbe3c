"""Events that wait to be written, in a file: they outlive the process that could not write them."""

from __future__ import annotations

import base64
import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal.form import event_of, record_of
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.output.json_file import Damaged, digest_of, read_json
from rulec_runtime.output.write_file import written


@dataclass(frozen=True)
class Pending:
    """Events in order, and the watcher's state after the last of them."""

    events: tuple[Event, ...] = ()
    state: bytes | None = None


def spill_beside(path: Path, plant: str) -> Path:
    """The usual place for what waits, beside a journal or a file of lines."""
    short = hashlib.sha256(plant.encode("utf-8", "replace")).hexdigest()[:8]
    return path.with_name(f"{path.name}.{short}.waiting.json")


def spill(file: Path, plant: str, pending: Pending, dated: bool) -> None:
    """Write what waits, as a whole; raises OSError where that cannot be."""
    state = pending.state
    data = {
        "plant": plant,
        "dated": dated,
        "events": [record_of(event, dated) for event in pending.events],
        "state": None if state is None else base64.b64encode(state).decode(),
    }
    data["digest"] = digest_of(data)
    with written(file) as stream:
        json.dump(data, stream, allow_nan=False)
        stream.flush()
        os.fsync(stream.fileno())


def waiting(file: Path, plant: str) -> Pending:
    """What was left to be written; nothing if the file is not there.

    Raises `JournalRefused` for a file of another plant, or one that somebody has changed.
    """
    try:
        data = read_json(file)
        if data["digest"] != digest_of(data):
            raise Damaged("somebody has changed it")
        if data["plant"] != plant:
            raise Damaged(f"its events are those of {data['plant']}, not of {plant}")
        state = data["state"]
        events = tuple(event_of(record) for record in data["events"])
        return Pending(events, None if state is None else base64.b64decode(state, validate=True))
    except FileNotFoundError:
        return Pending()
    except (Damaged, JournalRefused, KeyError, TypeError, ValueError, AttributeError) as error:
        reason = str(error) if isinstance(error, Damaged) else "it is none that rulec wrote"
        raise JournalRefused(
            f"{file} should hold events that wait to be written, but {reason}; move it away to "
            "start without them"
        ) from None
    except OSError as error:
        raise JournalRefused(f"{file}: {error.strerror or error}") from None
