"""The findings of a mismatch, read again from its file or from its result in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.join_recordings import read_recordings
from rulec_runtime.recordings.recording import Recording

from rulec.api.arguments import AnyPath, recording_given
from rulec.api.mismatch import MismatchResult
from rulec.effects.repair import (
    AGAIN,
    Proven,
    Repair,
    check_plant_unchanged,
    check_unchanged,
    proven_of,
    read_form,
    repair_of,
)
from rulec.passes.compile_cache import OpenedPlant, open_plant

if TYPE_CHECKING:
    from rulec.effects.model_builder import ModelBuilder


@dataclass(frozen=True, kw_only=True)
class Reread:
    """A repair, what was proven of it, and access to its plant and recordings.

    `file` holds it, `data` is its JSON form, `given` the result itself if it is in memory. With
    `recalibrated` it is the plain plant with other values.
    """

    file: Path
    data: Mapping[str, Any]
    given: MismatchResult | None
    recalibrated: bool

    @cached_property
    def repair(self) -> Repair:
        """The repair to write; raises `AdoptRefused` if there is none."""
        return repair_of(self.data, self.file, self.recalibrated)

    @cached_property
    def proven(self) -> Proven:
        """What the analysis found about it; raises `AdoptRefused` if the file is broken."""
        return proven_of(self.data, self.file, self.recalibrated)

    @cached_property
    def opened(self) -> OpenedPlant:
        """The plant as it is now."""
        return open_plant(self.repair.plant, effects=True)

    @cached_property
    def builder(self) -> ModelBuilder:
        """Builds models with effects of that plant."""
        from rulec.effects.model_builder import builder_of  # loads the compiler

        return builder_of(self.opened)

    def check_basis(self, kind: type[Refusal]) -> None:
        """Raise a refusal of a kind if it does not say which files it was made from."""
        if self.proven.basis is None:
            raise kind(f"{self.file}: it does not say which files it was made from; {AGAIN}")

    def check_unchanged(self) -> None:
        """Raise `AdoptRefused` if a file differs from the one in the analysis.

        For readings in memory only the plant can be checked.
        """
        sources, basis = self.opened.sources, self.proven.basis
        assert basis is not None
        if self.given is not None and basis.in_memory:
            check_plant_unchanged(basis, sources)
        else:
            check_unchanged(basis, sources)

    def recording(self, ruleset: Ruleset) -> Recording:
        """The recordings, read with a ruleset of the plant."""
        if self.given is not None:
            return recording_given(self.given.recordings, ruleset)
        assert self.proven.basis is not None
        return read_recordings([Path(path) for path in self.proven.basis.given], ruleset)


def reread(mismatch: MismatchResult | AnyPath, recalibrated: bool = False) -> Reread:
    """Read a mismatch again, or the `recalibrated` plant that it holds.

    Raises `AdoptRefused` if the file holds no repair.
    """
    if isinstance(mismatch, MismatchResult):
        file, data, given = Path("this mismatch"), mismatch.to_dict(), mismatch
        return Reread(file=file, data=data, given=given, recalibrated=recalibrated)
    file = Path(mismatch)
    return Reread(file=file, data=read_form(file), given=None, recalibrated=recalibrated)
