"""A case of tanks in the form that all cases of the proof have."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

from .. import sealed
from ..recording import write_csv
from .case import Case
from .detection_limit import detection_limits
from .folder import write_plant
from .refit import heldout_errors
from .right_answer import right


@dataclass(frozen=True)
class SealedCase:
    """A case with its answer; `concealed` are its ways of CONCEALMENTS."""

    made: Case
    concealed: tuple[str, ...]

    @functools.cached_property
    def answer(self) -> sealed.Answer:
        """The sealed answer; effects without an entry have the sort `unnamed`."""
        setup, effects = self.made.setup, self._effects()
        return sealed.Answer(
            case=self.made.name,
            half="dynamic",
            plant=setup.layout.name,
            profile=setup.profile,
            seed=self.made.seed,
            samples=setup.time.size,
            verdict=sealed.verdict_of([one.sort for one in effects]),
            concealed=self.concealed,
            effects=effects,
            difficulties=setup.told,
        )

    def write(self, folder: Path) -> None:
        """Write `plant/` and `recording.csv`: names and numbers in them reveal no effect."""
        write_plant(self.made.setup.layout, folder / "plant")
        write_csv(folder / "recording.csv", self.made.recording.readings)

    def reference(self, request: sealed.Request) -> sealed.Reference:
        """Return the errors of the true model, fitted to all samples that are not held out."""
        return sealed.Reference(heldout_errors(self.made, request.heldout))

    def _effects(self) -> tuple[sealed.Planted, ...]:
        found = []
        for one, limit in zip(self.made.planted, detection_limits(self.made), strict=True):
            effect, key = one.placed.effect, right(self.made.setup, one)
            found.append(
                sealed.Planted(
                    effect=effect.name,
                    title=effect.title,
                    sort=effect.sort if key.names else "unnamed",
                    module=one.placed.module,
                    place=effect.at,
                    names=key.names,
                    places=key.places,
                    parameters=key.parameters,
                    gain=limit.gain,
                    margin=limit.margin,
                    rival=limit.rival,
                )
            )
        return tuple(found)
