"""A case of tanks in the form that all cases of the proof have, with its folder for the tool."""

import functools
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from .. import sealed
from ..recording import write_csv
from .build import CASCADED, Layout
from .case import Case
from .detection_limit import detection_limits
from .model import heldout_errors
from .right_answer import right

_PACKAGE = Path(__file__).parents[3]
ROOT = _PACKAGE if (_PACKAGE / "kb").is_dir() else _PACKAGE.parent
"""Folder of kb and plants: the installed package, or a checkout."""

METERED_INFLOW = Path(__file__).with_name("metered-inflow.yaml")
"""A module type that is not shipped: the feed of a row with a flow meter."""

FILES = ("plant.yaml", "columns.yaml")


def write_plant(layout: Layout, folder: Path) -> Path:
    """Write the folder of a plant: drawing, columns, and knowledge that is not shipped.

    The files follow from the layout alone and contain no true parameter.
    """
    folder.mkdir(parents=True)
    for name, lines in zip(FILES, (_plant(layout), _columns(layout)), strict=True):
        if layout == CASCADED:
            shutil.copyfile(ROOT / "plants" / layout.name / name, folder / name)
        else:
            (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    if layout.metered:
        shutil.copytree(ROOT / "kb", folder / "kb")
        shutil.copy(METERED_INFLOW, folder / "kb" / "modules")
        with (folder / "plant.yaml").open("a", encoding="utf-8") as plant:
            plant.write("kb: kb\n")
    return folder


def _plant(layout: Layout) -> Iterator[str]:
    yield f"plant: {layout.name}"
    yield f"title: {len(layout.tanks)} open tanks in a row"
    yield "modules:"
    yield f"  {layout.feed}: {{type: {'metered-inflow' if layout.metered else 'voltage-pump'}}}"
    yield from (f"  {tank}: {{type: open-tank, title: tank {tank}}}" for tank in layout.tanks)
    yield "connections:"
    yield from (f"  - {a} -> {b}" for a, b in pairwise((layout.feed, *layout.tanks)))
    yield "columns: columns.yaml"


def _columns(layout: Layout) -> Iterator[str]:
    signal, unit = ("Q", "l/h") if layout.metered else ("u", "V")
    yield "columns:"
    yield '  time: {from: "time [s]", unit: s}'
    yield f'  {layout.feed}.{signal}: {{from: "{layout.input_column}", unit: {unit}}}'
    for tank, column in layout.columns.items():
        yield f'  {tank}.y: {{from: "{column}", unit: V}}'


@dataclass(frozen=True)
class SealedCase:
    """A case with its answer; `concealed` are its ways of CONCEALMENTS."""

    made: Case
    concealed: tuple[str, ...]

    @functools.cached_property
    def answer(self) -> sealed.Answer:
        """The sealed answer; effects without an entry have the sort `unnamed`."""
        setup, effects = self.made.setup, []
        limits = detection_limits(self.made)
        for one, (gain, margin, rival) in zip(self.made.planted, limits, strict=True):
            effect, key = one.placed.effect, right(setup, one)
            effects.append(
                sealed.Planted(
                    effect=effect.name,
                    title=effect.title,
                    sort=effect.sort if key.names else "unnamed",
                    module=one.placed.module,
                    place=effect.at,
                    names=key.names,
                    places=key.places,
                    parameters=key.parameters,
                    gain=gain,
                    margin=margin,
                    rival=rival,
                )
            )
        return sealed.Answer(
            case=self.made.name,
            half="dynamic",
            plant=setup.layout.name,
            profile=setup.profile,
            seed=self.made.seed,
            samples=setup.time.size,
            verdict=sealed.verdict_of([one.sort for one in effects]),
            concealed=self.concealed,
            effects=tuple(effects),
            difficulties=setup.told,
        )

    def write(self, folder: Path) -> None:
        """Write `plant/` and `recording.csv`: names and numbers in them reveal no effect."""
        write_plant(self.made.setup.layout, folder / "plant")
        write_csv(folder / "recording.csv", self.made.recording.readings)

    def reference(self, request: sealed.Request) -> sealed.Reference:
        """Return the errors of the true model, fitted to all samples that are not held out."""
        return sealed.Reference(heldout_errors(self.made, request.heldout))
