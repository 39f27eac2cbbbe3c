"""An opened plant: its ruleset, if kept, without the compiler; other results on demand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rulec_runtime.contract.ruleset import Ruleset

from rulec.knowledge.sources import Sources
from rulec.knowledge.sources_form import sources_form, sources_from
from rulec.passes.compile_cache import kept_of_plant, known_print, ruleset_of_plant

if TYPE_CHECKING:
    from rulec.passes.types import Compilation


@dataclass(frozen=True)
class OpenedPlant:
    """Documents of a plant and what is compiled from them; each result may raise `Refused`.

    `now` is the hash of all its sources, if it was known when they were read.
    """

    path: Path
    sources: Sources
    now: str | None

    @cached_property
    def ruleset(self) -> Ruleset:
        """The ruleset of an earlier start, or a new one if something has changed."""
        return ruleset_of_plant(self.path, lambda: self._compiled.ruleset, self.now)

    @cached_property
    def models(self) -> Compilation:
        """A compilation with the ruleset and all fields up to `types`."""
        ruleset = self.ruleset
        if "_compiled" in vars(self):
            return self._compiled
        from rulec.passes.pipeline import run_passes
        from rulec.passes.types import Compilation

        known = Compilation(path=self.path, sources=self.sources, ruleset=ruleset)
        return run_passes(known, "types")

    @cached_property
    def _compiled(self) -> Compilation:
        from rulec.passes.pipeline import run_passes
        from rulec.passes.types import Compilation

        return run_passes(Compilation(path=self.path, sources=self.sources))


def open_plant(path: Path, effects: bool = False) -> OpenedPlant:
    """Read a plant (folder or file); raises `Refused` with all mistakes of form.

    Only a comparison with recordings needs `effects`.
    """
    now = known_print(path)
    return OpenedPlant(path, sources_of_plant(path, effects, now), now)


def sources_of_plant(plant: Path, effects: bool = False, now: str | None = None) -> Sources:
    """The documents of a plant as `read_plant` gives them, read only if something has changed.

    `now` is as in `ruleset_of_plant`. Raises `Refused` with all mistakes of form.
    """
    read: list[Sources] = []

    def form() -> dict[str, Any]:
        from rulec.knowledge.read import read_plant

        read.append(read_plant(plant, effects))
        return sources_form(read[0])

    found = kept_of_plant(plant, "effects" if effects else "sources", form, now=now)
    return read[0] if read else sources_from(found, plant)
