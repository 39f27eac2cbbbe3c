"""`watch`: judge a plant while it runs and report events as they happen."""

import argparse
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from rulec_runtime.commands.watch_opened import Setup, set_up
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.live import limits, state
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import judged
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.recording import RecordingRefused


def run(options: argparse.Namespace, load: Callable[[Path], Ruleset] = read_ruleset) -> int:
    """Watch until the source ends or the user interrupts.

    The exit code is `limits.FAILED` if a status of `--fail-on` is active, and 1 if something could
    not be written in the end. Raises `RecordingRefused` if a source ends without a row.
    """
    ruleset = load(Path(options.plant))
    unwritten: list[str] = []
    with _ends_when_asked(), ExitStack() as stack:
        setup = set_up(options, ruleset, stack, unwritten)
        memory = _watch(setup, ruleset, options.until_end)
        over = (options.until_end or setup.source.ended) and not setup.screen.quit
        if over and not memory.count:
            raise RecordingRefused(f"{options.source}: it ended before a row that could be read")
    active = {one.status for one in memory.episodes if one.active}
    failed = active & set(options.fail_on.split(","))
    return limits.FAILED if failed else int(bool(unwritten))


def _watch(setup: Setup, ruleset: Ruleset, until_end: bool) -> Memory:
    memory, source, present = setup.memory, setup.source, setup.present
    with suppress(KeyboardInterrupt):
        while not source.ended and not setup.screen.quit:
            came = source.take(limits.WAIT)
            if not memory.count:
                # A source knows only from its first rows on whether its times are dates.
                recent = nothing_yet(source.dated, ruleset.time_zone).recent
                memory = replace(memory, recent=recent)
            events: list[Event] = []
            begun = time.monotonic()
            for updated, new, diagnosis in judged(ruleset, memory, came):
                memory = updated
                events += new
                present.update(memory, new, diagnosis)
                setup.screen.show(present.now())
            took = time.monotonic() - begun
            if came or events:
                _keep(setup, ruleset, memory, events)
            if not came and until_end:
                break
            setup.screen.show(present.now())
            for sink in setup.sinks:
                sink.show(present.now())
            if sum(len(one) for one in came if isinstance(one, Rows)) <= limits.ROWS_IN_TIME:
                # A large plant is judged at most half of the time; what comes meanwhile waits.
                time.sleep(took)
    return memory


def _keep(setup: Setup, ruleset: Ruleset, memory: Memory, events: Sequence[Event]) -> None:
    if setup.sinks:
        data = state.to_bytes(ruleset, memory, getattr(setup.source, "position", {}))
        for sink in setup.sinks:
            sink.put(list(events), data, dated=setup.source.dated)


@contextmanager
def _ends_when_asked() -> Iterator[None]:
    """SIGTERM, which stops a service, writes what waits just as Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
