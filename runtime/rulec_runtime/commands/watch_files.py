"""Events and state of a watch in files: patient while their disk is full."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from rulec_runtime.commands.watch_sinks import close, waiting_in
from rulec_runtime.live import limits
from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal.files import Files
from rulec_runtime.live.journal.lines import LinesFile
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.live.journal.sinks import KeptSink, WatchSink
from rulec_runtime.output.open_file import bytes_of


class KeptFiles:
    """Files with what waits for them; `folder` is where that is kept."""

    def __init__(self, files: Files, outbox: Outbox, plant: str, folder: Path) -> None:
        self._files, self._outbox, self._plant = files, outbox, plant
        self.folder = folder
        self._left = outbox.left  # before the file is read: what is written meanwhile stands there
        last = 0 if files.lines is None else files.lines.last(plant)
        self.sink: WatchSink = KeptSink(outbox, max(last, outbox.newest), waits=True)
        """Where events and states go."""

    def saved(self) -> list[tuple[bytes, str]]:
        """States that were kept, each with where that is; the one that has told most is the
        latest."""
        state = self._files.state
        found = []
        if state is not None and state.exists():
            found.append((bytes_of(state, limits.LARGEST_STATE), str(state)))
        if state is not None and self._left is not None:
            found.append((self._left[1], str(self._outbox.file)))
        return found

    def ahead(self, number: int) -> list[Event]:
        """Events beyond a state that ends with this number: it was killed between the two."""
        files = self._files
        if files.lines is None or files.state is None:
            return []
        return files.lines.after(self._plant, number)


def kept_files(
    events: str | None,
    state: str | None,
    plant: str,
    folder: Path | None,
    stack: ExitStack,
    unwritten: list[str],
) -> KeptFiles | None:
    """Open the files that are named, if any; at the end of `stack` what waits is written, or put
    into `unwritten`.

    Raises `JournalRefused` for a file of something else, or in a folder that is not there.
    """
    names = [Path(name) for name in (events, state) if name]
    if not names:
        return None
    for file in names:
        if not file.parent.is_dir():
            raise JournalRefused(f"{file}: there is no such folder")
    lines = LinesFile(Path(events)) if events else None
    if lines is not None:
        stack.callback(lines.close)
    folder = folder or names[-1].parent
    files = Files(lines, Path(state) if state else None)
    outbox = waiting_in(folder, names[0].name, files, plant)
    stack.callback(close, outbox, unwritten)
    return KeptFiles(files, outbox, plant, folder)
