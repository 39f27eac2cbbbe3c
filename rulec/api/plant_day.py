"""Ask what physics the model of one plant leaves out on one day; what a worker of a fleet does."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rulec_runtime.fleet.plant_day import fetched
from rulec_runtime.fleet.task import Task
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.terminal import one_line

from rulec.api.mismatch import mismatch


def ask_day(task: Task, plant: str) -> dict[str, Any]:
    """The answer in its JSON form; `plant` is the folder of the plant.

    Never raises for what stands in the files: such an answer is a ``reason``.
    """
    try:
        with ExitStack() as stack:
            files = [fetched(file, stack) for file in task.files]
            return mismatch(plant, _recordings(files)).to_dict()
    except (Refusal, OSError) as error:
        return {"reason": one_line(str(error))}
    except MemoryError:
        return {"reason": "it needs more memory than its worker has"}
    except Exception as error:  # our own bug: the other plants are to be asked all the same
        text = f"cannot be compared ({type(error).__name__}: {error})"
        return {"reason": one_line(text)[:300]}


def _recordings(files: list[Path]) -> list[Path]:
    """Files of one folder are one recording."""
    folders = {file.parent for file in files}
    return [*folders] if len(files) > 1 and len(folders) == 1 else files
