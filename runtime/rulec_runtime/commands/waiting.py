"""Events that wait until they can be written: where, and what becomes of them in the end."""

from __future__ import annotations

from pathlib import Path

from rulec_runtime.live.journal.outbox import Outbox, Sink
from rulec_runtime.live.journal.spill import spill_beside
from rulec_runtime.output.terminal import say_aside
from rulec_runtime.report.text import counted


def waiting_in(folder: Path | None, name: str, sink: Sink, plant: str) -> Outbox:
    """The outbox of a sink, which writes at once what an earlier process has left in the folder;
    without a folder events wait in memory alone."""
    file = None if folder is None else spill_beside(folder / name, plant)
    outbox = Outbox(sink, plant, say_aside, file=file)
    outbox.start()
    return outbox


def close(outbox: Outbox, unwritten: list[str]) -> None:
    """Write what waits as far as that works; what is left is said, and put into `unwritten`."""
    left = outbox.close()
    if not left:
        return
    text = f"{outbox.place}: {counted(left, 'event')} could not be written"
    file = outbox.file
    if file is not None and file.exists():
        text += f"; what waits stands in {file} and is written at the next start"
    else:
        text += " and nowhere else stands"
    say_aside(text)
    unwritten.append(text)
