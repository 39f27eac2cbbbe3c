"""Plant folders that the cases belong to, for the tool that is tested."""

from __future__ import annotations

import shutil
from pathlib import Path

from .build import CASCADED, Layout

ROOT = Path(__file__).parents[3]
OWN = Path(__file__).parents[1] / "plants"
"""Plants for tests only, each with its own module types."""


def plant_folder(layout: Layout, into: Path) -> Path:
    """The folder of a plant; one of the tests' own is put together with the shipped knowledge."""
    if layout == CASCADED:
        return ROOT / "plants" / layout.name
    folder = into / layout.name
    shutil.copytree(OWN / layout.name, folder, ignore=shutil.ignore_patterns("modules"))
    shutil.copytree(ROOT / "kb", folder / "kb")
    shutil.copytree(OWN / layout.name / "modules", folder / "kb" / "modules", dirs_exist_ok=True)
    with (folder / "plant.yaml").open("a", encoding="utf-8") as plant:
        plant.write("kb: kb\n")
    return folder
