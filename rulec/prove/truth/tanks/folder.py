"""Plant folders that the cases belong to, for the tool that is tested."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from .build import CASCADED, ROW, Layout

_PACKAGE = Path(__file__).parents[3]
ROOT = _PACKAGE if (_PACKAGE / "kb").is_dir() else _PACKAGE.parent
"""Of kb and plants: the installed package, or a checkout."""
OWN = Path(__file__).parents[1] / "plants"
"""Plants for tests only, each with its own module types."""

FILES = ("plant.yaml", "columns.yaml")


def plant_folder(layout: Layout, into: Path) -> Path:
    """The folder of a plant; one of the tests' own is put together with the shipped knowledge."""
    if layout == CASCADED:
        return ROOT / "plants" / layout.name
    return write_plant(layout, into / layout.name)


def write_plant(layout: Layout, folder: Path) -> Path:
    """Write the folder of a plant: drawing, columns, and knowledge if not all of it is shipped.

    What is written follows from the layout alone; no true parameter is in it.
    """
    folder.mkdir(parents=True)
    ready = {CASCADED.name: ROOT / "plants", ROW.name: OWN}.get(layout.name)
    for name, lines in zip(FILES, (_plant(layout), _columns(layout)), strict=True):
        if ready:
            shutil.copyfile(ready / layout.name / name, folder / name)
        else:
            (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    if layout.metered:
        _add_knowledge(folder)
    return folder


def _add_knowledge(folder: Path) -> None:
    """The shipped knowledge, and the tests' own module type of a metered inflow."""
    shutil.copytree(ROOT / "kb", folder / "kb")
    shutil.copytree(OWN / ROW.name / "modules", folder / "kb" / "modules", dirs_exist_ok=True)
    with (folder / "plant.yaml").open("a", encoding="utf-8") as plant:
        plant.write("kb: kb\n")


def _plant(layout: Layout) -> Iterator[str]:
    yield f"plant: {layout.name}"
    yield f"title: {len(layout.tanks)} open tanks in a row"
    yield "modules:"
    yield f"  {layout.feed}: {{type: {'metered-inflow' if layout.metered else 'voltage-pump'}}}"
    yield from (f"  {tank}: {{type: open-tank, title: tank {tank}}}" for tank in layout.tanks)
    yield "connections:"
    line = (layout.feed, *layout.tanks)
    yield from (f"  - {a} -> {b}" for a, b in pairwise(line))
    yield "columns: columns.yaml"


def _columns(layout: Layout) -> Iterator[str]:
    signal, unit = ("Q", "l/h") if layout.metered else ("u", "V")
    yield "columns:"
    yield '  time: {from: "time [s]", unit: s}'
    yield f'  {layout.feed}.{signal}: {{from: "{layout.input_column}", unit: {unit}}}'
    for tank, column in layout.columns.items():
        yield f'  {tank}.y: {{from: "{column}", unit: V}}'
