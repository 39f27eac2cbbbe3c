"""What an analysis was made from, by hash; an adoption must be made from the same."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rulec_runtime.recordings.recording_file import files_of
from rulec_runtime.recordings.recording_path import STANDARD_INPUT, bytes_of, is_there

from rulec.effects.repair import AdoptRefused, Basis
from rulec.knowledge.sources import Sources

AGAIN = "run rulec mismatch again"


def basis_of(
    sources: Sources, recordings: Sequence[Path], in_memory: bool = False
) -> dict[str, Any]:
    """Hashes by path of the plant's files, the whole knowledge base and the recordings.

    Paths are absolute, so that `rulec adopt` finds them from any folder. `in_memory`: some
    recordings have no path.
    """
    return {
        "plant": _hashes(_plant_files(sources)),
        "given": [_real(recording) for recording in recordings],
        "recordings": _hashes(_files(recordings)),
        **({"in_memory": True} if in_memory else {}),
    }


def check_unchanged(basis: Basis, sources: Sources) -> list[Path]:
    """The recordings in the order given; raises `AdoptRefused` if anything has changed."""
    if basis.in_memory:
        raise AdoptRefused(
            "a recording was in memory, and it must be read again; give the result of "
            f"rulec.mismatch itself, or write the recording to a file and {AGAIN}"
        )
    check_plant_unchanged(basis, sources)
    recordings = [Path(recording) for recording in basis.given]
    for recording in recordings:
        if recording.name == STANDARD_INPUT.name:
            raise AdoptRefused(
                "the recording came from standard input, and it must be read again; keep it in a "
                "file, and run rulec mismatch with that"
            )
        if not is_there(recording):
            raise AdoptRefused(
                f"the recording '{recording}' is not there any more, and it must be read again; "
                f"put it back, or {AGAIN}"
            )
    _compare("recording", basis.recordings, _hashes(_files(recordings)))
    return recordings


def check_plant_unchanged(basis: Basis, sources: Sources) -> None:
    """Raises `AdoptRefused` if a file of the plant has changed since the analysis."""
    _compare("plant", basis.plant, _hashes(_plant_files(sources)))


def _files(recordings: Iterable[Path]) -> list[Path]:
    return [file for recording in recordings for file in files_of(recording)]


def _compare(what: str, then: Mapping[str, str], now: Mapping[str, str]) -> None:
    if then == now:
        return
    other = sorted(name for name in then.keys() | now.keys() if then.get(name) != now.get(name))
    name = other[0]
    happened = "is gone" if name not in now else "is new" if name not in then else "has changed"
    more = f" (and {len(other) - 1} other files)" if len(other) > 1 else ""
    raise AdoptRefused(
        f"'{name}'{more} {happened} since the analysis; what was found may not hold for this "
        f"{what}. Put it back as it was, or {AGAIN}"
    )


def _plant_files(sources: Sources) -> Iterator[Path]:
    assert sources.plant is not None
    file = Path(sources.plant.path)
    yield file
    data = sources.plant.data
    names = [data.get("columns"), data.get("adjacency"), *data.get("calibration", ())]
    yield from (file.parent / name for name in names if name)
    for layer in sources.layers:
        yield from layer.files


def _hashes(files: Iterator[Path] | list[Path]) -> dict[str, str]:
    return {_real(file): hashlib.sha256(bytes_of(file)).hexdigest() for file in files}


def _real(file: Path) -> str:
    """The real path; `Path.resolve` would raise on a link to itself."""
    return Path(os.path.realpath(file)).as_posix()
