"""What survives the process: the memory of a watch as bytes.

It is data only, nothing is executed: an archive of arrays (npz without pickles) with one text,
everything else as JSON.
"""

import dataclasses
import io
import json
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.batch_means import Halves
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.live import limits
from rulec_runtime.live.episode import Episode
from rulec_runtime.live.history import History
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.recordings.recording import RecordingRefused
from rulec_runtime.recordings.stationary import Timeline

TABLES = ("values", "u", "systematic", "bad", "lag", "stood_in")
TIMELINE = ("since", "until", "samples", "later", "paused")


def to_bytes(ruleset: Ruleset, memory: Memory, position: Mapping[str, Any]) -> bytes:
    """The memory and the position of the source."""
    recent, before = memory.recent, memory.before
    arrays: dict[str, Array] = {"recent/time": recent.time, "recent/segment": recent.segment}
    arrays |= {f"recent/values/{name}": column for name, column in recent.values.items()}
    why: Mapping[str, str] = {}
    if before is not None:
        why = before.points.why
        arrays["before/time"] = np.asarray(before.points.time)
        for table in TABLES:
            columns = getattr(before.points, table)
            arrays |= {f"before/{table}/{name}": column for name, column in columns.items()}
        arrays |= {f"timeline/{name}": getattr(before.timeline, name) for name in TIMELINE}
        arrays |= {"halves/apart": before.halves.apart, "halves/excess": before.halves.excess}
    text = json.dumps(
        {
            "form": limits.STATE_FORM,
            "plant": ruleset.plant,
            "sources": ruleset.sources,
            "dated": recent.calendar is not None,
            "count": memory.count,
            "number": memory.number,
            "episodes": [dataclasses.asdict(one) for one in memory.episodes],
            "why": dict(why),
            "before": before is not None,
            "position": dict(position),
        }
    )
    written = io.BytesIO()
    np.savez(written, allow_pickle=False, text=np.array(text), **arrays)
    return written.getvalue()


def from_bytes(ruleset: Ruleset, data: bytes, name: str) -> tuple[Memory, dict[str, Any]]:
    """The memory and the position of the source; `name` stands for the state in messages.

    Raises `RecordingRefused` for bytes that are not a state, or one of another ruleset.
    """
    broken = RecordingRefused(f"{name}: this is no state of a watch; remove it to begin anew")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            if sum(part.file_size for part in packed.infolist()) > len(data):
                raise broken  # states are not compressed, so this is a zip bomb
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = dict(archive)
        text = json.loads(str(arrays.pop("text")))
        own = (text["form"], text["plant"], text["sources"])
        if own != (limits.STATE_FORM, ruleset.plant, ruleset.sources):
            raise RecordingRefused(
                f"{name}: this state is of another ruleset (plant '{text['plant']}'); remove it to "
                "begin anew, or name another file"
            )
        return _memory(ruleset, arrays, text), dict(text["position"])
    except (ValueError, LookupError, OSError, EOFError, zipfile.BadZipFile, TypeError,
            AttributeError, RuntimeError, MemoryError) as error:  # fmt: skip
        raise broken from error


def _memory(ruleset: Ruleset, arrays: Mapping[str, Array], text: Mapping[str, Any]) -> Memory:
    values = _under(arrays, "recent/values/")
    recent = dataclasses.replace(
        nothing_yet(text["dated"], ruleset.time_zone).recent,
        time=arrays["recent/time"],
        segment=arrays["recent/segment"],
        values=values,
        missing=tuple(s.id for s in ruleset.signals if s.id in ruleset.read and s.id not in values),
    )
    before = None
    if text["before"]:
        tables = {table: _under(arrays, f"before/{table}/") for table in TABLES}
        times: dict[str, Any] = {name: arrays[f"timeline/{name}"] for name in TIMELINE}
        before = History(
            Points(**tables, why=text["why"], time=arrays["before/time"]),
            Halves(arrays["halves/apart"], arrays["halves/excess"]),
            Timeline(**times),
        )
    # JSON has no tuples.
    episodes = tuple(
        Episode(
            **{
                **one,
                "alternatives": tuple((n, p) for n, p in one["alternatives"]),
                "told": one["told"] and tuple(one["told"]),
            }
        )
        for one in text["episodes"]
    )
    return Memory(
        recent=recent, before=before, count=text["count"], episodes=episodes, number=text["number"]
    )


def _under(arrays: Mapping[str, Array], prefix: str) -> dict[str, Array]:
    return {name[len(prefix) :]: a for name, a in arrays.items() if name.startswith(prefix)}
