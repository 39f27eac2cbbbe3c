"""Full updates in a separate process, so that they do not delay the rows.

A thread would alternate with the rows, and each of its turns takes as long as a row may take. The
process starts with the first full update. It gets the ruleset once, then the memory for each
update. It ends with this process, or when it is killed. Objects that both processes have are sent
by name.
"""

from __future__ import annotations

import io
import multiprocessing
import os
import pickle
import signal
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.independent_parts import parts_of
from rulec_runtime.live.full_update import evaluated
from rulec_runtime.live.last_evaluation import Evaluation
from rulec_runtime.live.memory import Memory
from rulec_runtime.output.interrupts import interrupts_held

ENDED = (EOFError, OSError)
"""What a connection raises when the process at its other end has ended."""


@dataclass(frozen=True)
class _Running:
    """The process, this end of the pipe to it, and the thread that waits for its answers."""

    process: BaseProcess
    ours: Connection
    thread: ThreadPoolExecutor

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.thread.shutdown(wait=True)
        self.ours.close()


class UpdateProcess:
    """Runs full updates in one process, one at a time; must be closed."""

    def __init__(self, ruleset: Ruleset) -> None:
        # A copy without cached properties: the process computes them itself.
        self._ruleset = pickle.dumps(replace(ruleset), pickle.HIGHEST_PROTOCOL)
        self._running: _Running | None = None

    @property
    def pid(self) -> int | None:
        """Id of the process; None without one."""
        return None if self._running is None else self._running.process.pid

    def begin(self, ruleset: Ruleset, memory: Memory, headers: bool = True) -> RemoteUpdate:
        """Start a full update of the memory; `headers` as in `evaluated`."""
        what = replace(memory, known=None, under_way=None)
        parts = [written(ruleset, (what, headers))]
        if self._running is None or not self._running.process.is_alive():
            self.close()
            self._running = _started()
            parts.insert(0, self._ruleset)
        answer = self._running.thread.submit(_answer, self._running.ours, parts)
        return RemoteUpdate(self, ruleset, what, headers, answer)

    def close(self) -> None:
        """Kill the process."""
        if self._running is not None:
            self._running.end()
            self._running = None


def _started() -> _Running:
    # Spawned: threads may hold a lock, and other systems cannot fork.
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=serve, args=(theirs,), daemon=True)
    try:
        with interrupts_held():
            process.start()
    except KeyboardInterrupt:
        # Nobody else has it, and this process would wait for it at its end.
        process.kill()
        raise
    theirs.close()
    return _Running(process, ours, ThreadPoolExecutor(1, "look"))


@dataclass(frozen=True)
class RemoteUpdate:
    """A full update in the process."""

    process: UpdateProcess
    ruleset: Ruleset
    memory: Memory
    headers: bool
    answer: Future[bytes]

    def found(self, wait: bool) -> Evaluation | None:
        """Its result; None while it runs. If its process has died, it is repeated here."""
        if not wait and not self.answer.done():
            return None
        try:
            data = self.answer.result()
        except ENDED:
            return evaluated(self.ruleset, self.memory, self.headers)
        found = read(self.ruleset, data)
        if isinstance(found, Exception):
            raise found
        assert isinstance(found, Evaluation)
        return found

    def drop(self) -> None:
        """Kill the process, so that nothing waits for this update."""
        if not self.answer.done():
            self.process.close()


def _answer(ours: Connection, parts: list[bytes]) -> bytes:
    """Send parts and wait for the answer; in a thread, as a pipe holds little."""
    for part in parts:
        ours.send_bytes(part)
    return ours.recv_bytes()


def serve(theirs: Connection) -> None:
    """Run full updates until the connection ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    ruleset = pickle.loads(theirs.recv_bytes())
    while True:
        try:
            memory, headers = read(ruleset, theirs.recv_bytes())
        except ENDED:
            return
        found: Evaluation | Exception
        try:
            found = evaluated(ruleset, memory, headers)
        except Exception as error:
            found = error
        theirs.send_bytes(written(ruleset, found))


def _end_with_parent() -> None:
    """End this process with its parent, even during an update."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def written(ruleset: Ruleset, what: object) -> bytes:
    """Pickle an object without the ruleset in it."""
    names = {id(thing): name for name, thing in _shared(ruleset).items()}
    out = io.BytesIO()
    _Writer(out, names).dump(what)
    return out.getvalue()


def read(ruleset: Ruleset, data: bytes) -> Any:
    """Unpickle what another process of this program wrote, with this ruleset in it."""
    return _Reader(io.BytesIO(data), _shared(ruleset)).load()


def _shared(ruleset: Ruleset) -> dict[str, object]:
    """Objects of both processes, by name: the ruleset, its parts, its faults."""
    found: dict[str, object] = {f"fault {i}": f for i, f in enumerate(ruleset.faults)}
    for i, part in enumerate(parts_of(ruleset)):
        found |= {f"part {i}": part, f"ruleset {i}": part.ruleset}
    return {**found, "ruleset": ruleset}


class _Writer(pickle.Pickler):
    def __init__(self, out: io.BytesIO, names: dict[int, str]) -> None:
        super().__init__(out, protocol=pickle.HIGHEST_PROTOCOL)
        self._names = names

    def persistent_id(self, obj: object) -> str | None:
        return self._names.get(id(obj))


class _Reader(pickle.Unpickler):
    def __init__(self, data: io.BytesIO, shared: dict[str, object]) -> None:
        super().__init__(data)
        self._shared = shared

    def persistent_load(self, pid: str) -> object:
        return self._shared[pid]
