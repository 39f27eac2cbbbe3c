"""What goes from one process to the other: what both have is named, and never sent."""

from __future__ import annotations

import io
import pickle
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.parts import parts_of


def written(ruleset: Ruleset, what: object) -> bytes:
    """Something as bytes, without the ruleset in it."""
    names = {id(thing): name for name, thing in _had(ruleset).items()}
    out = io.BytesIO()
    writer = _Writer(out, names)
    writer.dump(what)
    return out.getvalue()


def read(ruleset: Ruleset, data: bytes) -> Any:
    """What another process of this program wrote, with this ruleset in it."""
    return _Reader(io.BytesIO(data), _had(ruleset)).load()


def _had(ruleset: Ruleset) -> dict[str, object]:
    """What both have, by name: the ruleset, its parts, its faults."""
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
    def __init__(self, data: io.BytesIO, had: dict[str, object]) -> None:
        super().__init__(data)
        self._had = had

    def persistent_load(self, pid: str) -> object:
        return self._had[pid]
