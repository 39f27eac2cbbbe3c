"""Random rows of tanks, and their files as a plant engineer writes them."""

import itertools
import shutil
from itertools import pairwise
from pathlib import Path

from ..streams import stream
from .plant import CASCADED, Layout

NAMES = (
    ("upper", "centre", "lower", "bottom"),
    ("north", "east", "south", "west"),
    ("T1", "T2", "T3", "T4"),
    ("settling", "buffer", "storage", "sump"),
)
FEEDS, MAINS = ("pump", "supply", "P1"), ("mains", "inflow", "F1")

FEWEST, MOST = 2, 4
"""Tanks in a row."""

ALSO_MEASURED = 0.4
"""Probability that a tank above the last one is also measured."""

METERED = 0.4
"""Probability that a flow meter shows the feed, instead of the voltage of a pump."""

INTERVALS = (3.0, 4.0, 5.0)
"""s"""


def row(seed: int) -> Layout:
    """Draw a row of tanks; the last one is measured, as nothing else depends on it."""
    random = stream(seed, "row")
    count = int(random.integers(FEWEST, MOST + 1))
    tanks = NAMES[int(random.integers(len(NAMES)))][:count]
    also = random.uniform(size=count - 1) < ALSO_MEASURED
    measured = (*itertools.compress(tanks, also), tanks[-1])
    metered = bool(random.uniform() < METERED)
    feed = (MAINS if metered else FEEDS)[int(random.integers(len(FEEDS)))]
    interval = float(random.choice(INTERVALS))
    columns = {tank: f"L{tanks.index(tank) + 1} [V]" for tank in measured}
    inlet = "F [l/h]" if metered else "u [V]"
    return Layout(f"row-{seed}", feed, tanks, measured, metered, interval, inlet, columns)


_PACKAGE = Path(__file__).parents[3]
ROOT = _PACKAGE if (_PACKAGE / "kb").is_dir() else _PACKAGE.parent
"""Folder of kb and plants: the installed package, or a checkout."""

METERED_INFLOW = Path(__file__).with_name("metered-inflow.yaml")
"""A module type that is not shipped: the feed of a row with a flow meter."""


def write_plant(layout: Layout, folder: Path) -> Path:
    """Write the folder of a plant: drawing, columns, and knowledge that is not shipped.

    The files follow from the layout alone and contain no true parameter.
    """
    signal, unit = ("Q", "l/h") if layout.metered else ("u", "V")
    files = {
        "plant.yaml": [
            f"plant: {layout.name}",
            f"title: {len(layout.tanks)} open tanks in a row",
            "modules:",
            f"  {layout.feed}: {{type: {'metered-inflow' if layout.metered else 'voltage-pump'}}}",
            *(f"  {tank}: {{type: open-tank, title: tank {tank}}}" for tank in layout.tanks),
            "connections:",
            *(f"  - {a} -> {b}" for a, b in pairwise((layout.feed, *layout.tanks))),
            "columns: columns.yaml",
            *(["kb: kb"] if layout.metered else []),
        ],
        "columns.yaml": [
            "columns:",
            '  time: {from: "time [s]", unit: s}',
            f'  {layout.feed}.{signal}: {{from: "{layout.input_column}", unit: {unit}}}',
            *(f'  {t}.y: {{from: "{column}", unit: V}}' for t, column in layout.columns.items()),
        ],
    }
    folder.mkdir(parents=True)
    for name, lines in files.items():
        if layout == CASCADED:
            shutil.copyfile(ROOT / "plants" / layout.name / name, folder / name)
        else:
            (folder / name).write_text("\n".join([*lines, ""]), encoding="utf-8")
    if layout.metered:
        shutil.copytree(ROOT / "kb", folder / "kb")
        shutil.copy(METERED_INFLOW, folder / "kb" / "modules")
    return folder
