"""`rulec mismatch`: where simulation and recording differ, and which physics is left out."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from rich.console import Console
from rulec_runtime.commands.destinations import STANDARD_OUTPUT, progress_of, show_files, write_to
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.nearest import nearest
from rulec_runtime.output.refusal import Misused, Refusal
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.join_recordings import names_of, read_recordings
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.page_origin import made_now
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import listed

from rulec.commands.arguments import (
    Plant,
    Recorded,
    folder_of,
    is_path,
    names_given,
    recording_given,
)
from rulec.commands.result import AnyPath, Columns, PageResult, parts_of
from rulec.effects.candidate import Repair
from rulec.effects.repair import (
    AGAIN,
    Proven,
    basis_of,
    check_plant_unchanged,
    check_unchanged,
    plant_of,
    proven_of,
    read_form,
    repair_of,
)
from rulec.limits import UNSURE
from rulec.mismatch.answer.json_form import latent_csv
from rulec.mismatch.result import MismatchRefused
from rulec.passes.compile_cache import OpenedPlant, open_plant

if TYPE_CHECKING:
    from rulec.effects.model_builder import ModelBuilder
    from rulec.mismatch.result import Finding, Mismatch


Periods = Sequence[tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class MismatchResult(PageResult):
    """What a model leaves out, with proof on samples that it never used.

    Attributes
    ----------
    found : the whole answer.
    plant : its folder or file.
    recordings : as given; `rulec.adopt` and `rulec.experiment` read them again.
    subject : plant and recording, for the head of the page.

    Tables: `findings` (a row each), and `series` (measured and predicted courses, a row per
    sample).
    """

    found: Mismatch
    plant: Path
    recordings: tuple[Recorded, ...]
    basis: Mapping[str, Any]
    subject: Subject

    def __repr__(self) -> str:
        return f"<MismatchResult {self.found.plant}: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """``none``, ``named``, ``unnamed``, ``fault``, ``sensor``, ``ambiguous``, ``unsure`` or
        ``cannot judge``."""
        return self.found.verdict

    @property
    def headline(self) -> str:
        """The answer in a sentence or two."""
        return self.found.headline

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Physics, faults and sensors that explain the difference."""
        return self.found.findings

    def to_dict(self, series: str | None = None) -> dict[str, Any]:
        """The answer as `rulec mismatch --json` writes it, for `rulec adopt`; numbers in SI.

        `series` names a file with the course of an unrecorded driver.
        """
        from rulec.mismatch.answer.json_form import mismatch_form

        form = mismatch_form(self.found, self.plant.resolve().as_posix(), series)
        form["repair"]["made_from"] = dict(self.basis)
        return form

    def page(self) -> str:
        """The report, one page of HTML with pictures."""
        from rulec.mismatch.answer.terminal_and_page import report

        return report(self.found, self.subject, made_now("rulec"))

    def series_csv(self) -> str:
        """Measured and predicted courses, a row per sample."""
        from rulec.mismatch.inference.heldout_errors import series_csv

        return series_csv(self.found.series)

    def tell(self, out: Console) -> None:
        """Print the whole story."""
        from rulec.mismatch.answer.terminal_and_page import tell

        tell(out, self.found)

    def _findings(self) -> Columns:
        names = ("sort", "name", "title", "module", "place", "probability", "closed", "equation")
        return parts_of((*names, "text"), self.findings)

    def _series(self) -> Columns:
        from rulec.mismatch.inference.heldout_errors import MODELS

        series = self.found.series
        if series is None:
            return {"time [s]": np.zeros(0), "heldout": np.zeros(0, dtype=bool)}
        columns: dict[str, Any] = {"time [s]": series.time, "heldout": np.asarray(series.heldout)}
        for course in series.courses:
            for name in ("measured", *MODELS):
                columns[f"{course.signal} {name} [{course.unit}]"] = getattr(course, name)
        return columns

    _tables: ClassVar = {"findings": _findings, "series": _series}


def mismatch(
    plant: Plant,
    recordings: Recorded | Sequence[Recorded],
    *,
    heldout: Periods = (),
    power: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> MismatchResult:
    """Find where simulation and recording differ, and which physics is left out.

    Parameters
    ----------
    plant : folder with a plant.yaml, that file, or what `rulec.compile` returned.
    recordings : one, or a list of several of one plant: paths, data frames, or mappings of arrays
        of shape (n,); units as in the titles.
    heldout : spans of time, s, that test the result and play no part in the search; by default
        blocks are set aside.
    power : ids of effects to conceal in replays of the recording by the plant's own model. An
        empty list: the reported ones. None: no replays.
    progress : called with each task that begins.

    Raises
    ------
    Refused
        The plant has mistakes.
    RecordingRefused
        One is no recording of the plant, or they cannot be judged together.
    MismatchRefused
        Spans hold no sample or all of them, the plant has storage and several are given, or no
        effect has an id.

    Examples
    --------
    >>> import rulec
    >>> rulec.mismatch("plants/abc", "plants/abc/examples/healthy.csv").verdict  # doctest: +SKIP
    'none'
    """
    tell_progress = progress or (lambda text: None)
    given: tuple[Any, ...] = (recordings,)
    if isinstance(recordings, list | tuple):
        given = tuple(recordings)
    if not given:
        raise Misused("give one recording at least")
    folder = folder_of(plant)
    tell_progress("reading the plant")
    plant_now = open_plant(folder, effects=True)
    ruleset = plant_now.ruleset
    if len(given) > 1 and ruleset.dynamics is not None:
        raise MismatchRefused(
            "this plant has storage: what a recording began with belongs to it alone, and several "
            "cannot be judged together. Judge each recording alone, or record the experiment as one"
        )
    names = names_given(given)
    paths = [name for name, one in zip(names, given, strict=True) if is_path(one)]
    basis = basis_of(plant_now.sources, paths, in_memory=len(paths) < len(given))
    tell_progress("reading the recording" if len(given) == 1 else "reading the recordings")
    recording = recording_given(given, ruleset)
    _check_heldout(recording, heldout)
    from rulec.effects.model_builder import builder_of  # loads the compiler
    from rulec.mismatch.analyse import analyse

    builder = builder_of(plant_now)
    _check_effects(power or (), builder)
    found = analyse(recording, ruleset, builder, heldout=heldout, power=power, progress=progress)
    notes = tuple(dict.fromkeys((*found.notes, *recording.notes)))
    found = replace(found, recording=listed(names_of(names)), notes=notes)
    subject = Subject.of(ruleset, recording, found.recording)
    return MismatchResult(found=found, plant=folder, recordings=given, basis=basis, subject=subject)


def _check_effects(asked: Sequence[str], builder: ModelBuilder) -> None:
    known = {c.id for c in builder.candidates} if asked else set()
    for id_ in asked:
        if id_ not in known:
            near = nearest(id_, known)
            meant = f"; did you mean '{near}'?" if near else ""
            raise MismatchRefused(
                f"--power {id_}: no effect of this plant has that id{meant or ';'} "
                "'rulec show effects PLANT' lists them"
            )


def _check_heldout(recording: Recording, heldout: Periods) -> None:
    """Refuse periods that hold no sample, or all of them."""
    time, inside = recording.time, np.isnan(recording.time)
    for since, until in heldout:
        here = (time >= since) & (time <= until)
        if not here.any():
            raise MismatchRefused(
                f"--heldout {since:g}:{until:g}: the recording has no sample there; it runs from "
                f"{time[0]:g} s to {time[-1]:g} s"
            )
        inside |= here
    if inside.all():
        raise MismatchRefused(
            "--heldout takes the whole recording; leave a part from which to find something"
        )


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
        return open_plant(plant_of(self.data, self.file), effects=True)

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


def run(options: argparse.Namespace) -> int:
    """Compare. A mismatch is a result, so the exit code is 0; for the verdict `unsure` it is
    `UNSURE`, as a script must not take that for sound."""
    heldout = periods_of(options.heldout)
    folder_of(options.plant)
    with progress_of(options, "reading the plant") as progress:
        found = mismatch(
            options.plant,
            options.recording,
            heldout=heldout,
            power=options.power,
            progress=progress,
        )
    if options.series:
        write_to(options.series, found.series_csv())
    series = _write_latent(options, found)
    out = found.hand_out(options, found.to_dict(series.name if series else None))
    courses = {"courses of the models": options.series, "course of what is not recorded": series}
    show_files(out, {"report": options.report, **courses})
    return UNSURE if found.verdict == "unsure" else 0


def periods_of(texts: Sequence[str]) -> Periods:
    """Held-out periods, s; raises `Misused` for a bad one.

    >>> periods_of(["0:60", "120:180.5"])
    ((0.0, 60.0), (120.0, 180.5))
    """
    periods = []
    for text in texts:
        parts = text.split(":")
        try:
            since, until = (float(part) for part in parts)
        except ValueError:
            since = until = math.nan
        if not (math.isfinite(since) and math.isfinite(until)):
            raise Misused(
                f"--heldout {text}: give two numbers of seconds with a colon between, as in 600:900"
            )
        if not since < until:
            raise Misused(
                f"--heldout {text}: it ends before it begins; did you mean {parts[1]}:{parts[0]}?"
                if until < since
                else f"--heldout {text}: it has no length"
            )
        periods.append((since, until))
    return tuple(periods)


def _write_latent(options: argparse.Namespace, found: MismatchResult) -> Path | None:
    """Write the course of a hidden driver beside the JSON file; returns its file."""
    latent = found.found.latent_input
    if latent is None or options.json in (None, STANDARD_OUTPUT):
        return None
    target = Path(options.json)
    series = target.with_name(f"{target.stem}.hidden.csv")
    write_text(series, latent_csv(latent))
    return series
