"""What a source gave, judged in its order: rows that follow each other as one block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live.beside import BackgroundUpdates
from rulec_runtime.live.connection import noticed, read_again
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import Memory, follow, looked_beside
from rulec_runtime.live.rows import Notice, Rows


def judged(
    ruleset: Ruleset,
    memory: Memory,
    came: Sequence[Rows | Notice],
    looks: BackgroundUpdates | None = None,
) -> Iterator[tuple[Memory, tuple[Event, ...], Diagnosis | None]]:
    """What is remembered after each block of rows and each notice, what is new, and the diagnosis
    of rows. `looks`: where looks go on beside the rows; one that has ended while nothing came is
    told as well."""
    for item in _blocks(came):
        if isinstance(item, Notice):
            memory, told = noticed(memory, item)
            yield memory, told, None
            continue
        memory, told = read_again(memory, item)
        if told:
            yield memory, told, None
        for said in follow(ruleset, memory, item, looks):
            memory = said.memory
            yield memory, said.events, said.diagnosis
    if not came and (late := looked_beside(ruleset, memory, looks)) is not None:
        yield late.memory, late.events, late.diagnosis


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
