"""Files for what waits to be written, so that it survives the process."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal.event_records import event_of, record_of
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.output.json_file import Damaged, digest_of, read_json
from rulec_runtime.output.write_file import written

T = TypeVar("T")


@dataclass(frozen=True)
class Note:
    """An acknowledgement of an episode, `at` s since 1970."""

    episode: str
    by: str
    at: float


@dataclass(frozen=True)
class Pending:
    """Events in order, and the state of the watcher after the last; `dated` if times are s since
    1970."""

    events: tuple[Event, ...] = ()
    state: bytes | None = None
    dated: bool = True


def spill_beside(path: Path, plant: str) -> Path:
    """The usual path for what waits, beside a journal or a file of lines."""
    short = hashlib.sha256(plant.encode("utf-8", "replace")).hexdigest()[:8]
    return path.with_name(f"{path.name}.{short}.waiting.json")


def notes_beside(file: Path) -> Path:
    """The path for pending acknowledgements, beside that of the events."""
    return file.with_name(file.name.replace(".waiting.", ".acknowledged."))


def spill(file: Path, plant: str, pending: Pending) -> None:
    """Save what waits, as a whole; raises OSError."""
    state, dated = pending.state, pending.dated
    data = {
        "plant": plant,
        "dated": dated,
        "events": [record_of(event, dated) for event in pending.events],
        "state": None if state is None else base64.b64encode(state).decode(),
    }
    _write(file, data)


def waiting(file: Path, plant: str) -> Pending:
    """What was saved; nothing if there is no file.

    Raises `JournalRefused` for a file of another plant, or one that somebody has changed.
    """

    def pending(data: Any) -> Pending:
        state = data["state"]
        events = tuple(event_of(record) for record in data["events"])
        kept = None if state is None else base64.b64decode(state, validate=True)
        return Pending(events, kept, bool(data["dated"]))

    return _read(file, plant, "events", pending) or Pending()


def spill_notes(file: Path, plant: str, notes: Sequence[Note]) -> None:
    """Save pending acknowledgements; removes the file without any. Raises OSError."""
    if not notes:
        file.unlink(missing_ok=True)
        return
    _write(file, {"plant": plant, "notes": [dataclasses.astuple(note) for note in notes]})


def waiting_notes(file: Path, plant: str) -> tuple[Note, ...]:
    """The saved acknowledgements. Raises `JournalRefused` as `waiting` does."""

    def notes(data: Any) -> tuple[Note, ...]:
        return tuple(Note(str(episode), str(by), float(at)) for episode, by, at in data["notes"])

    return _read(file, plant, "acknowledgements", notes) or ()


def _write(file: Path, data: dict[str, Any]) -> None:
    data["digest"] = digest_of(data)
    with written(file) as stream:
        json.dump(data, stream, allow_nan=False)
        stream.flush()
        os.fsync(stream.fileno())


def _read(file: Path, plant: str, what: str, content: Callable[[Any], T]) -> T | None:
    try:
        data = read_json(file)
        if data["digest"] != digest_of(data):
            raise Damaged("somebody has changed it")
        if data["plant"] != plant:
            raise Damaged(f"its {what} are those of {data['plant']}, not of {plant}")
        return content(data)
    except FileNotFoundError:
        return None
    except (Damaged, JournalRefused, KeyError, TypeError, ValueError, AttributeError) as error:
        reason = str(error) if isinstance(error, Damaged) else "it is none that rulec wrote"
        raise JournalRefused(
            f"{file} should hold {what} that wait to be written, but {reason}; move it away to "
            "start without them"
        ) from None
    except OSError as error:
        raise JournalRefused(f"{file}: {error.strerror or error}") from None
