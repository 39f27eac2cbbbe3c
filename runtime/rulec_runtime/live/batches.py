"""Judge rows and notices of a source in their order, with successive rows as one block."""

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live.connection import noticed, read_again
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import follow
from rulec_runtime.live.memory import Memory
from rulec_runtime.live.rows import Notice, Rows


def judged(
    ruleset: Ruleset, memory: Memory, came: Sequence[Rows | Notice]
) -> Iterator[tuple[Memory, tuple[Event, ...], Diagnosis | None]]:
    """Memory and events after each block of rows and each notice, and the diagnosis of the rows."""
    for item in _blocks(came):
        if isinstance(item, Notice):
            memory, events = noticed(memory, item)
            yield memory, events, None
            continue
        memory, events = read_again(memory, item)
        if events:
            yield memory, events, None
        for update in follow(ruleset, memory, item):
            memory = update.memory
            yield memory, update.events, update.diagnosis


def _blocks(came: Sequence[Rows | Notice]) -> Iterator[Rows | Notice]:
    """Notices, and successive rows of the same signals as one block."""
    for _, group in groupby(came, lambda item: isinstance(item, Rows) and set(item.values)):
        items = list(group)
        rows = [item for item in items if isinstance(item, Rows)]
        if not rows:
            yield from items
            continue
        values = {name: np.concatenate([r.values[name] for r in rows]) for name in rows[0].values}
        yield Rows(np.concatenate([r.time for r in rows]), values)
