"""A central part that knows no equation: it asks the modules' code for estimates with faults
undone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset

from rulec.export.play_on_recording import Execute
from rulec.export.program import ModuleCode, Routine, Value


@dataclass(frozen=True)
class Asked:
    """Stands for the plan `undo` of a ruleset; answers come from the routines `undo`."""

    ruleset: Ruleset
    routines: tuple[Routine, ...]
    execute: Execute
    outputs: tuple[str, ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(name for name in self.ruleset.undo.inputs if name in self.used_inputs)

    @property
    def used_inputs(self) -> frozenset[str]:
        wanted = set(self.outputs)
        asked = [r for r in self.routines if wanted & {v.id for v in r.outputs}]
        ids = {v.id for r in asked for v in r.inputs}
        return frozenset(i for i in ids if not i.startswith("good:"))

    @property
    def operations(self) -> tuple[str, ...]:
        """None here: all is asked at once."""
        return ()

    def select(self, outputs: Iterable[str]) -> Asked:
        return self.selected(outputs)

    def selected(self, outputs: Iterable[str]) -> Asked:
        return Asked(self.ruleset, self.routines, self.execute, tuple(outputs))

    def narrowed(self) -> Asked:
        return self

    def run(self, values: Mapping[str, Value]) -> dict[str, Value]:
        found: dict[str, Value] = {}
        for routine in self.routines:
            wanted = {v.id: v.name for v in routine.outputs if v.id in self.outputs}
            if not wanted:
                continue
            said = self.execute(routine, dict(self._inputs(routine, values)))
            flags = {v.id: v.name for v in routine.outputs if v.id.startswith("valid:")}
            for id_, name in wanted.items():
                valid = said[flags[f"valid:{id_.split(':')[1]}"]]
                found[id_] = np.where(valid, said[name], np.nan)
        return {name: found[name] for name in self.outputs}

    def _inputs(self, routine: Routine, values: Mapping[str, Value]):  # type: ignore[no-untyped-def]
        n = max(np.size(v) for v in values.values())
        for v in routine.inputs:
            kind, _, name = v.id.rpartition(":")
            if kind == "x":
                yield v.name, values[v.id] + np.zeros(n)
            elif kind == "good":
                yield v.name, np.isfinite(values[name]) & np.ones(n, dtype=bool)
            else:
                yield v.name, self.ruleset.signal_by_id[name].shown(values[name]) + np.zeros(n)


def asking(ruleset: Ruleset, codes: Iterable[ModuleCode], execute: Execute) -> Asked:
    """What stands for `ruleset.undo`."""
    routines = tuple(r for code in codes for r in code.routines if r.name == "undo")
    # Routines know the faults of modules, and no change of the liquid.
    known = tuple(n for n in ruleset.undo.outputs if n.startswith(("q:", "dq:")))
    return Asked(ruleset, routines, execute, known)
