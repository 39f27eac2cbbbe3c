"""A case of tanks in the form that all cases of the proof have."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

from .. import sealed
from ..recording import write_csv
from .case import Case
from .folder import write_plant
from .key import right
from .refit import heldout_errors
from .seen import seen

HALF = "dynamic"
RECORDING = "recording.csv"
PLANT = "plant"


@dataclass(frozen=True)
class SealedCase:
    """A case that was made; `concealed` are its ways of CONCEALMENTS."""

    made: Case
    concealed: tuple[str, ...]

    @functools.cached_property
    def answer(self) -> sealed.Answer:
        """The sealed answer; what no entry names is of the sort `unnamed`."""
        own = self.made.answer
        effects = self._effects()
        return sealed.Answer(
            own.case,
            HALF,
            own.plant,
            own.profile,
            own.seed,
            own.samples,
            sealed.verdict_of([one.sort for one in effects]),
            self.concealed,
            effects,
        )

    def write(self, folder: Path) -> None:
        """Write `plant/` and `recording.csv`: names and numbers in them tell no effect."""
        write_plant(self.made.setup.layout, folder / PLANT)
        write_csv(folder / RECORDING, self.made.recording.readings)

    def reference(self, request: sealed.Request) -> sealed.Reference:
        """The true model, fitted to all but held-out samples."""
        return sealed.Reference(heldout_errors(self.made, request.heldout))

    def _effects(self) -> tuple[sealed.Planted, ...]:
        found = []
        for one, limit in zip(self.made.planted, seen(self.made), strict=True):
            effect, key = one.placed.effect, right(self.made.setup, one)
            found.append(
                sealed.Planted(
                    effect.name,
                    effect.title,
                    effect.sort if key.names else "unnamed",
                    one.placed.module,
                    effect.at,
                    key.names,
                    key.places,
                    key.parameters,
                    limit.gain,
                    limit.margin,
                    limit.rival,
                )
            )
        return tuple(found)
