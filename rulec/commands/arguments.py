"""Arguments of the functions: plants and recordings, by path or in memory."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.output.refusal import Misused
from rulec_runtime.recordings.join_recordings import read_recordings, together
from rulec_runtime.recordings.recording import Recording, recording_of
from rulec_runtime.recordings.recording_file import (
    RecordingFile,
    different,
    file_of,
    files_of,
    read_file,
)

from rulec.commands.compile import CompileResult
from rulec.commands.result import AnyPath, columns_of

if TYPE_CHECKING:
    from narwhals.typing import IntoFrame
    from numpy.typing import ArrayLike

Plant: TypeAlias = "AnyPath | CompileResult"
"""Folder with a plant.yaml, that file, a ruleset file, or what `rulec.compile` returned."""

Recorded: TypeAlias = "AnyPath | IntoFrame | Mapping[str, ArrayLike]"
"""A file of any format, a folder of them, or readings in memory with titles as in a file:
``time [s]`` and ``A.dp [bar]``, or foreign names that the plant's column map knows."""


def is_path(given: object) -> bool:
    """Whether an argument names a file or folder."""
    return isinstance(given, str | os.PathLike)


def ruleset_of(plant: Plant) -> Ruleset:
    """The ruleset of a plant, compiled if necessary; only then is the compiler loaded."""
    if not isinstance(plant, str | os.PathLike):
        return plant.ruleset
    path = Path(plant)
    if path.suffix == ".json":
        return read_ruleset(path)
    from rulec.passes.compile_cache import ruleset_of_plant

    return ruleset_of_plant(path)


def folder_of(
    plant: Plant,
    lacking: str = "a ruleset does not hold the equations into which physics could be built",
) -> Path:
    """Folder or file of a plant; raises `Misused` for a ruleset, with what it is `lacking`."""
    path = Path(plant) if isinstance(plant, str | os.PathLike) else plant.path
    if path.suffix == ".json":
        raise Misused(f"{path}: give the plant's folder; {lacking}")
    return path


def names_given(recordings: Sequence[Recorded]) -> list[Path]:
    """The name of each recording in messages: its path, or a name for data in memory."""
    numbers = [""] if len(recordings) == 1 else [f" {i + 1}" for i in range(len(recordings))]
    return [
        Path(given if isinstance(given, str | os.PathLike) else f"data frame{number}")
        for given, number in zip(recordings, numbers, strict=True)
    ]


def recording_given(recordings: Sequence[Recorded], ruleset: Ruleset) -> Recording:
    """One recording, or several of one plant joined.

    Raises `RecordingRefused` if one is no recording of this plant, or if they cannot be judged
    together.
    """
    names = names_given(recordings)
    if all(is_path(given) for given in recordings):
        return read_recordings(names, ruleset)
    different(recordings)
    parts = []
    for name, given in zip(names, recordings, strict=True):
        notes: list[str] = []
        parts.append(recording_of(name, files_given(given, name, ruleset, notes), ruleset, notes))
    return parts[0] if len(parts) == 1 else together(names, parts, ruleset)


def files_given(
    given: Recorded, name: Path, ruleset: Ruleset, notes: list[str]
) -> list[RecordingFile]:
    """The files of a recording; data in memory count as one file."""
    if is_path(given):
        return [read_file(path, ruleset, notes) for path in files_of(name)]
    columns, zoned = columns_of(given, str(name))
    return [file_of(str(name), columns, ruleset, notes, zoned)]
