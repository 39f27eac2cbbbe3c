"""`watch`: judge a plant while it runs; events come out as they happen."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rulec_runtime.commands.destinations import console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live import limits, state
from rulec_runtime.live.connection import noticed
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import Memory, follow, nothing_yet
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.view.live_screen import LiveScreen
from rulec_runtime.live.view.present import Present
from rulec_runtime.output.terminal import say_aside, styled
from rulec_runtime.output.write_file import write_data
from rulec_runtime.recordings.recording import RecordingRefused

if TYPE_CHECKING:
    from rulec_runtime.live.journal.lines import LinesFile
    from rulec_runtime.live.journal.outbox import Outbox
    from rulec_runtime.live.journal.store import Journal


def run(options: argparse.Namespace, load: Callable[[Path], Ruleset] = read_ruleset) -> int:
    """Watch until the source ends, or somebody interrupts."""
    ruleset = load(Path(options.plant))
    if options.state and options.journal:
        raise RecordingRefused("--journal keeps the state as well; leave out --state")
    with ExitStack() as stack:
        return _watched(options, ruleset, stack)


def _watched(options: argparse.Namespace, ruleset: Ruleset, stack: ExitStack) -> int:
    kept = Path(options.state) if options.state else None
    journal = _journal(options.journal, ruleset.plant, stack) if options.journal else None
    memory, position = _restored(ruleset, kept, journal)
    source = open_source(
        options.source, ruleset, Path(options.map) if options.map else None, position or None
    )
    out = console(options)
    events = _lines(Path(options.events), stack) if options.events else None
    written = 0 if events is None else events.last(ruleset.plant)
    out.print(styled("[dim]watching {} of plant {}; Ctrl-C ends[/]", options.source, ruleset.plant))
    present = Present(ruleset, options.source, memory)
    if options.page:
        url = _page(options.page, present, stack)
        out.print(styled("[dim]page: {}[/]", url))
    screen = stack.enter_context(LiveScreen(present.acknowledge, out, told=memory.number))
    outbox: Outbox | None = None
    with closing(source), suppress(KeyboardInterrupt):
        while not source.ended and not screen.quit:
            came = source.take(limits.WAIT)
            if not memory.count:
                # Whether its times are dates a source knows from its first rows on.
                recent = nothing_yet(ruleset, source.dated).recent
                memory = replace(memory, recent=recent)
            news: list[Event] = []
            for remembered, told, diagnosis in _judged(ruleset, memory, came):
                memory = remembered
                news += told
                present.update(memory, told, diagnosis)
                screen.show(present.now())
                if events is not None:
                    # After a kill some are told again, perhaps with a later digit changed.
                    new = [event for event in told if event.number > written]
                    events.commit(ruleset.plant, new, None, dated=source.dated)
            if came and (kept is not None or journal is not None):
                position = getattr(source, "position", {})
                data = state.to_bytes(ruleset, memory, position)
                if kept is not None:
                    # Behind the events: a kill in between tells them again, with the same numbers.
                    write_data(kept, data)
                if journal is not None:
                    outbox = outbox or _outbox(journal, ruleset.plant, source.dated, stack)
                    outbox.put(news, data)
            if not came:
                if options.until_end:
                    break
                screen.show(present.now())
    active = {one.status for one in memory.episodes if one.active}
    return limits.FAILED if active & set(options.fail_on.split(",")) else 0


def _restored(
    ruleset: Ruleset, kept: Path | None, journal: Journal | None
) -> tuple[Memory, Mapping[str, Any]]:
    """What was remembered when the process ended, and how far the source was read."""
    if journal is not None and (saved := journal.state(ruleset.plant)) is not None:
        return state.from_bytes(ruleset, saved.state, journal.place)
    if kept is not None and kept.exists():
        return state.from_bytes(ruleset, kept.read_bytes(), str(kept))
    return nothing_yet(ruleset, False), {}


def _journal(where: str, plant: str, stack: ExitStack) -> Journal:
    """The journal, held for this process until it ends."""
    from rulec_runtime.live.sources.refused import extra

    extra("sqlalchemy", "journal")
    from rulec_runtime.live.journal.store import open_journal

    journal = open_journal(where)
    stack.callback(journal.close)
    journal.hold(plant)
    stack.callback(journal.release, plant)
    return journal


def _lines(path: Path, stack: ExitStack) -> LinesFile:
    """The file that events are put behind."""
    from rulec_runtime.live.journal.lines import LinesFile

    events = LinesFile(path)
    stack.callback(events.close)
    return events


def _page(where: str, present: Present, stack: ExitStack) -> str:
    """Serve the page at ``PORT`` of loopback or at ``HOST:PORT``; its address."""
    from rulec_runtime.live.sources.refused import extra

    extra("starlette", "page")
    extra("uvicorn", "page")
    from rulec_runtime.live.view.page import serve

    host, _, port = where.rpartition(":")
    if not port.isdecimal() or int(port) > limits.LAST_PORT:
        raise RecordingRefused(f"--page {where[:60]}: write PORT or HOST:PORT, such as 8080")
    token = os.environ.get("RULEC_TOKEN")
    host = host.strip("[]") or "127.0.0.1"
    page = serve(present.now, host, int(port), token, present.acknowledge)
    stack.callback(page.close)
    return page.url


def _outbox(journal: Journal, plant: str, dated: bool, stack: ExitStack) -> Outbox:
    """What waits for the journal; what is left is written before the process ends."""
    from rulec_runtime.live.journal.outbox import Outbox

    outbox = Outbox(journal, plant, say_aside, dated=dated)
    outbox.start()
    stack.callback(outbox.close)
    return outbox


def _judged(
    ruleset: Ruleset, memory: Memory, came: Sequence[Rows | Notice]
) -> Iterator[tuple[Memory, tuple[Event, ...], Diagnosis | None]]:
    """What is remembered after each block of rows and each notice, what is new, and the diagnosis
    of rows."""
    for item in _blocks(came):
        if isinstance(item, Notice):
            memory, told = noticed(memory, item)
            yield memory, told, None
            continue
        for said in follow(ruleset, memory, item):
            memory = said.memory
            yield memory, said.events, said.diagnosis


def _blocks(came: Sequence[Rows | Notice]) -> Iterator[Rows | Notice]:
    """Rows that follow each other as one block: they are judged once."""
    waiting: list[Rows] = []
    for item in came:
        if isinstance(item, Rows) and (
            not waiting or waiting[-1].values.keys() == item.values.keys()
        ):
            waiting.append(item)
            continue
        if waiting:
            yield _one(waiting)
        waiting = [item] if isinstance(item, Rows) else []
        if isinstance(item, Notice):
            yield item
    if waiting:
        yield _one(waiting)


def _one(rows: Sequence[Rows]) -> Rows:
    values = {name: np.concatenate([r.values[name] for r in rows]) for name in rows[0].values}
    return Rows(np.concatenate([r.time for r in rows]), values)
