"""Open the source, sinks and displays of a watch."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rulec_runtime.commands.destinations import console
from rulec_runtime.commands.watch_sinks import host_and_port, sinks_of
from rulec_runtime.commands.watch_storage import KeptFiles, KeptJournal, kept_files, kept_journal
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import state
from rulec_runtime.live.journal.sinks import WatchSink
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.live.moment import Present
from rulec_runtime.live.rows import Source
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.sources.remarks import extra
from rulec_runtime.live.state import ReplayedSource, replayed
from rulec_runtime.live.view.live_screen import LiveScreen
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.recording import RecordingRefused

Acknowledge = Callable[[str, str], None]


@dataclass(frozen=True)
class Opened:
    """Everything that a watch uses, and its memory at the start."""

    memory: Memory
    source: Source
    present: Present
    screen: LiveScreen
    sinks: tuple[WatchSink, ...]


def opened(
    options: argparse.Namespace, ruleset: Ruleset, stack: ExitStack, unwritten: list[str]
) -> Opened:
    """Open what the options name. `stack` closes it; `unwritten` then gets a message for what could
    not be written. Raises `Refusal` for mistakes of the user."""
    if options.state and options.journal:
        raise RecordingRefused("--journal keeps the state as well; leave out --state")
    folder = _waiting(options)
    journal = None
    if options.journal:
        journal = kept_journal(options.journal, ruleset.plant, folder, stack, unwritten)
    waiting = folder or (None if journal is None else journal.folder)
    files = kept_files(options.events, options.state, ruleset.plant, waiting, stack, unwritten)
    memory, position = _restored(ruleset, files, journal)
    own = None if files is None else files.folder
    sinks = sinks_of(options, ruleset, waiting or own, stack)
    map_path = Path(options.map) if options.map else None
    source: Source = open_source(options.source, ruleset, map_path, position or None)
    stack.callback(source.close)
    if files is not None:
        sinks.insert(0, files.sink)
        if ahead := files.ahead(memory.number):
            memory, source = replayed(memory, ahead), ReplayedSource(source, ahead)
    out = console(options)
    first = styled("[dim]watching {} of plant {}; Ctrl-C ends[/]", options.source, ruleset.plant)
    out.print(first, soft_wrap=True)
    present = Present(ruleset, options.source, memory)
    acknowledge: Acknowledge = present.acknowledge
    if journal is not None:
        sinks.append(journal.sink)
        acknowledge = journal.joined_to(present, stack)
    if options.page:
        url = _page(options.page, present, acknowledge, stack)
        out.print(styled("[dim]page: {}[/]", url))
    screen = stack.enter_context(LiveScreen(acknowledge, out, told=memory.number))
    return Opened(memory, source, present, screen, tuple(sinks))


def _waiting(options: argparse.Namespace) -> Path | None:
    if options.waiting is not None and not Path(options.waiting).is_dir():
        raise RecordingRefused(f"--waiting {options.waiting}: there is no such folder")
    return Path(options.waiting) if options.waiting else None


def _restored(
    ruleset: Ruleset, files: KeptFiles | None, journal: KeptJournal | None
) -> tuple[Memory, Mapping[str, Any]]:
    """The latest saved memory, and the position of the source."""
    saved = [] if files is None else files.saved()
    if journal is not None and (kept := journal.saved()) is not None:
        saved.append(kept)
    found = [state.from_bytes(ruleset, *one) for one in saved]
    latest = max(found, key=lambda one: (one[0].number, one[0].count), default=None)
    return (nothing_yet(False), {}) if latest is None else latest


def _page(where: str, present: Present, acknowledge: Acknowledge, stack: ExitStack) -> str:
    """Serve the page at ``PORT`` of loopback or at ``HOST:PORT``; returns its address."""
    extra("starlette", "page")
    extra("uvicorn", "page")
    from rulec_runtime.live.view.page import serve

    host, port = host_and_port("--page", where)
    page = serve(present.now, host, port, os.environ.get("RULEC_TOKEN"), acknowledge)
    stack.callback(page.close)
    return page.url
