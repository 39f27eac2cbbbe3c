"""Which physics the model of a plant leaves out on one day: the task of a worker of a fleet."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rulec_runtime.fleet.plant_day import Task, fetched
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.terminal import one_line

from rulec.api.mismatch import mismatch


def ask_day(task: Task, plant: str) -> dict[str, Any]:
    """The answer in JSON form; `plant` is the folder of the plant.

    Never raises for the content of files: the answer is then a ``reason``.
    """
    try:
        with ExitStack() as stack:
            files = [fetched(file, stack) for file in task.files]
            return mismatch(plant, _recording(files, stack)).to_dict()
    except (Refusal, OSError) as error:
        return {"reason": one_line(str(error))}
    except MemoryError:
        return {"reason": "it needs more memory than its worker has"}
    except Exception as error:  # our own bug must not stop the other plants
        text = f"cannot be compared ({type(error).__name__}: {error})"
        return {"reason": one_line(text)[:300]}


def _recording(files: list[Path], stack: ExitStack) -> Path:
    """The files of a plant-day as one recording: their common folder, or a new one of links."""
    folders = {file.parent for file in files}
    if len(files) == 1:
        return files[0]
    if len(folders) == 1:
        return folders.pop()
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rulec-")))
    for number, file in enumerate(files):
        (folder / f"{number:04d}-{file.name}").symlink_to(file.resolve())
    return folder
