"""Events as JSON lines, each written once and whole, whatever ends the process."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

from rulec_runtime.output.terminal import machine_text
from rulec_runtime.recordings.recording import RecordingRefused


class EventFile:
    """A file that events are put behind; those that stand in it already are not written again."""

    def __init__(self, path: Path, plant: str) -> None:
        self._file: BinaryIO = path.open("a+b")
        self._last = _last_number(self._file, path, plant)

    def write(self, forms: Iterable[dict[str, Any]]) -> None:
        """Put events behind the others; they are on the disk when this returns."""
        new = [form for form in forms if form["number"] > self._last]
        if not new:
            return
        lines = "".join(
            machine_text(json.dumps(form, ensure_ascii=False, allow_nan=False)) + "\n"
            for form in new
        )
        self._file.write(lines.encode())
        self._file.flush()
        os.fsync(self._file.fileno())
        self._last = new[-1]["number"]

    def close(self) -> None:
        """Nothing more to write."""
        self._file.close()


def _last_number(file: BinaryIO, path: Path, plant: str) -> int:
    """Number of the last event in a file; a half line at its end, left by a kill, is cut off."""
    file.seek(0)
    whole, last = 0, 0
    for line in file:
        if not line.endswith(b"\n"):
            break
        try:
            form = json.loads(line)
            own, last = form["plant"], int(form["number"])
        except (ValueError, KeyError, TypeError):
            raise RecordingRefused(f"{path}: this is no file of events; name a new one") from None
        if own != plant:
            raise RecordingRefused(f"{path}: these are events of plant '{own}'; name a new file")
        whole += len(line)
    file.truncate(whole)
    file.seek(0, os.SEEK_END)
    return last
