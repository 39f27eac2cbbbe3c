"""`watch`: judge a plant while it runs; events come out as they happen."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rulec_runtime.commands.destinations import console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.live import state
from rulec_runtime.live.connection import noticed
from rulec_runtime.live.episode import Event
from rulec_runtime.live.event_file import EventFile
from rulec_runtime.live.follower import Memory, follow, nothing_yet
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.told import form_of, line_of
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_bytes

WAIT = 0.2
"""Seconds to wait for rows before looking whether anything else is to be done."""

FAILED = 3
"""Exit code where something is active that was asked for with --fail-on."""


def run(options: argparse.Namespace, load: Callable[[Path], Ruleset] = read_ruleset) -> int:
    """Watch until the source ends, or somebody interrupts."""
    ruleset = load(Path(options.plant))
    kept = Path(options.state) if options.state else None
    memory, position = _restored(ruleset, kept)
    source = open_source(
        options.source, ruleset, Path(options.map) if options.map else None, position or None
    )
    out = console(options)
    events = EventFile(Path(options.events), ruleset.plant) if options.events else None
    out.print(styled("[dim]watching {} of plant {}; Ctrl-C ends[/]", options.source, ruleset.plant))
    with closing(source), suppress(KeyboardInterrupt):
        while not source.ended:
            came = source.take(WAIT)
            if not memory.count:
                # Whether its times are dates a source knows from its first rows on.
                recent = nothing_yet(ruleset, source.dated).recent
                memory = replace(memory, recent=recent)
            for now, told in _judged(ruleset, memory, came):
                memory, calendar = now, now.recent.calendar
                for event in told:
                    out.print(line_of(event, calendar))
                if events is not None:
                    events.write(form_of(event, ruleset.plant, calendar) for event in told)
            if kept is not None and came:
                # Behind the events: a kill in between tells them again, with the same numbers.
                position = getattr(source, "position", {})
                write_bytes(kept, state.to_bytes(ruleset, memory, position))
            if options.until_end and not came:
                break
    active = {one.status for one in memory.episodes if one.active}
    return FAILED if active & set(options.fail_on.split(",")) else 0


def _restored(ruleset: Ruleset, kept: Path | None) -> tuple[Memory, Mapping[str, Any]]:
    """What was remembered when the process ended, and how far the source was read."""
    if kept is None or not kept.exists():
        return nothing_yet(ruleset, False), {}
    return state.from_bytes(ruleset, kept.read_bytes(), str(kept))


def _judged(
    ruleset: Ruleset, memory: Memory, came: Sequence[Rows | Notice]
) -> Iterator[tuple[Memory, tuple[Event, ...]]]:
    """What is remembered after each block of rows and each notice, and what is new."""
    for item in _blocks(came):
        if isinstance(item, Notice):
            memory, told = noticed(memory, item)
            yield memory, told
            continue
        for said in follow(ruleset, memory, item):
            memory = said.memory
            yield memory, said.events


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
