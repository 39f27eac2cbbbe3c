"""What a mismatch found, taken up again: from its file, or from its result in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.together import read_recordings

from rulec.api.given import AnyPath, recording_given
from rulec.api.mismatch import MismatchResult
from rulec.effects.made_from import AGAIN, check_plant_unchanged, check_unchanged
from rulec.effects.repair import Basis, Proven, Repair, proven_of, read_form, repair_of
from rulec.passes.deferred_compilation import OpenedPlant, open_plant

if TYPE_CHECKING:
    from rulec.effects.model_builder import ModelBuilder

IN_MEMORY = Path("this mismatch")
"""What messages call a result in memory."""


@dataclass(frozen=True, kw_only=True)
class Reread:
    """A repair, what was proven of it, and the way back to plant and recordings.

    `file` is where it stands, `data` its JSON form, `given` the result itself where it is in
    memory. With `recalibrated` it is the plain plant with other values.
    """

    file: Path
    data: Mapping[str, Any]
    given: MismatchResult | None
    recalibrated: bool

    @cached_property
    def repair(self) -> Repair:
        """What is written; raises `AdoptRefused` where there is nothing."""
        return repair_of(self.data, self.file, self.recalibrated)

    @cached_property
    def proven(self) -> Proven:
        """What was found of it; raises `AdoptRefused` where the file is broken."""
        return proven_of(self.data, self.file, self.recalibrated)

    @cached_property
    def opened(self) -> OpenedPlant:
        """The plant as it is now."""
        return open_plant(self.repair.plant, effects=True)

    @cached_property
    def builder(self) -> ModelBuilder:
        """Its modules with anything built in."""
        from rulec.effects.model_builder import builder_of  # loads the compiler

        return builder_of(self.opened)

    def check_basis(self, kind: type[Refusal]) -> Basis:
        """What it was made from; raises a refusal of a kind where that is not said."""
        if self.proven.basis is None:
            raise kind(f"{self.file}: it does not say which files it was made from; {AGAIN}")
        return self.proven.basis

    def check_unchanged(self) -> None:
        """Raises `AdoptRefused` where a file is another one than in the analysis.

        Of readings in memory nobody knows.
        """
        sources, basis = self.opened.sources, self.proven.basis
        assert basis is not None
        if self.given is not None and basis.in_memory:
            check_plant_unchanged(basis, sources)
        else:
            check_unchanged(basis, sources)

    def recording(self, ruleset: Ruleset) -> Recording:
        """The recordings, read for a ruleset of the plant."""
        if self.given is not None:
            return recording_given(self.given.recordings, ruleset)
        assert self.proven.basis is not None
        return read_recordings([Path(path) for path in self.proven.basis.given], ruleset)


def reread(mismatch: MismatchResult | AnyPath, recalibrated: bool = False) -> Reread:
    """Take up a mismatch again, or the `recalibrated` plant that it holds.

    Raises `AdoptRefused` where the file holds no repair.
    """
    given = mismatch if isinstance(mismatch, MismatchResult) else None
    file = IN_MEMORY if isinstance(mismatch, MismatchResult) else Path(mismatch)
    data = read_form(file) if given is None else given.to_dict()
    return Reread(file=file, data=data, given=given, recalibrated=recalibrated)
