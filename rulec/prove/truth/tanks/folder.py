"""Plant folders of the cases, for the tool that is tested."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from .build import CASCADED, Layout

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
