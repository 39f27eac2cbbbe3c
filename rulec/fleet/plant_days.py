"""The plant-days of a fleet: files below folders that name plant and day."""

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from urllib.parse import unquote

from rulec_runtime.fleet.plant_day import Row, Task, blank, judge_day
from rulec_runtime.output.open_file import check_address
from rulec_runtime.output.refusal import Refusal, to_install
from rulec_runtime.recordings.formats import is_called_recording

from rulec.engines.call import Call, Engine
from rulec.engines.engine import run
from rulec.fleet.fleet_file import Fleet
from rulec.limits import WORKER_DEATHS

Found = tuple[str, str]
"""Address of a file, and its mark, which contains size and time of change."""


def tasks_of(fleet: Fleet) -> list[Task]:
    """All plant-days of a fleet, in order of days and plants. Raises `Refusal` if there is none."""
    days: dict[tuple[str, str], list[Found]] = {}
    for address, mark in _files(fleet.recordings):
        keys = _keys(address)
        plant, day = keys.get(fleet.plant_key), keys.get(fleet.day_key)
        if plant is None or day is None or not _wanted(fleet, plant, day):
            continue
        days.setdefault((day, plant), []).append((address, mark))
    if not days:
        raise Refusal(
            f"{fleet.recordings}: no recording below {fleet.plant_key}=.../{fleet.day_key}=... of "
            "the plants and days that the fleet asks for"
        )
    tasks = []
    for (day, plant), files in sorted(days.items()):
        addresses, marks = zip(*sorted(files), strict=True)
        task = Task(
            plant=plant,
            day=day,
            files=addresses,
            marks=marks,
            ruleset=fleet.plants.get(plant, fleet.default),
            trace=fleet.trace,
        )
        tasks.append(task)
    return tasks


def _wanted(fleet: Fleet, plant: str, day: str) -> bool:
    if plant not in fleet.plants and (fleet.only_named or not fleet.default):
        return False
    return (not fleet.first or fleet.first <= day) and (not fleet.last or day <= fleet.last)


def _keys(address: str) -> dict[str, str]:
    """Names and values of the partitions of a file.

    >>> _keys("data/plant=P%201/day=2026-01-01/a.parquet")
    {'plant': 'P 1', 'day': '2026-01-01'}
    """
    folders = address.replace(os.sep, "/").split("/")[:-1]
    parts = [folder.partition("=") for folder in folders if "=" in folder]
    return {unquote(name): unquote(value) for name, _, value in parts}


def _files(place: str) -> Iterator[Found]:
    if "://" in place:
        yield from _elsewhere(place)
        return
    if not Path(place).is_dir():
        raise Refusal(f"{place}: there is no such folder of recordings")
    for folder, _, names in os.walk(place):
        for name in names:
            file = Path(folder) / name
            if is_called_recording(file):
                # A broken link fails with its own plant-day, and does not stop the others.
                state = file.stat() if file.exists() else file.lstat()
                yield str(file), f"{state.st_size} {state.st_mtime_ns}"


def _elsewhere(place: str) -> Iterator[Found]:
    try:
        import fsspec
    except ModuleNotFoundError:
        raise Refusal(
            f"{place}: to read recordings from there, install what that needs: "
            f"{to_install('fleet', 'rulec')}"
        ) from None
    try:
        system, root = fsspec.core.url_to_fs(check_address(place))
        listed = system.find(root, detail=True)
    except Refusal:
        raise
    except Exception as error:  # the libraries behind fsspec have exceptions of their own
        message = f"{place}: cannot be listed ({error})"
        raise Refusal(re.sub("//[^/@]*@", "//", message)) from None  # without a password
    for path, state in listed.items():
        if is_called_recording(Path(path)):
            marks = (state.get(k) for k in ("size", "mtime", "LastModified", "etag", "ETag"))
            yield system.unstrip_protocol(path), " ".join(str(m) for m in marks if m is not None)


def judged(
    engine: Engine, tasks: Sequence[Task], rulesets: Mapping[str, str]
) -> Iterator[tuple[Task, Row]]:
    """Rows as they are done; `rulesets` are texts by hash."""
    calls = [Call((task,), task.ruleset) for task in tasks]
    return worked_off(engine, judge_day, tasks, calls, blank, rulesets)


def worked_off(
    engine: Engine,
    work: Callable[..., Row],
    tasks: Sequence[Task],
    calls: Sequence[Call],
    undone: Callable[[Task], Row],
    shared: Mapping[str, str] | None = None,
) -> Iterator[tuple[Task, Row]]:
    """Results of plant-days as they are done, by a call of `work` for each.

    If processes die repeatedly at a plant-day, the reason stands in its `undone` result.
    """

    def died(number: int) -> Row:
        reason = f"{WORKER_DEATHS} processes died at it; is there enough memory?"
        return undone(tasks[number]) | {"reason": reason}

    for number, row in run(engine, work, calls, shared, died):
        yield tasks[number], row
