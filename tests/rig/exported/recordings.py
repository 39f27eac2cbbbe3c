"""Shipped and real recordings of settled plants, each with the plant that judges it."""

from collections.abc import Iterator
from pathlib import Path

from tests.conftest import ROOT, recordings_folder
from tests.rig import esp, zema

HSY = "hsy-wastewater-pumping/hsy_15min.csv"
ZEMA = "zema-hydraulic"
CYCLES = range(300, 500)
"""Of the ZeMA rig: with leakages of all sizes."""


def shipped() -> Iterator[tuple[Path, Path]]:
    """Plants with their examples."""
    for plant in ("abc", "mixing-rig"):
        folder = ROOT / "plants" / plant
        for file in sorted((folder / "examples").glob("*.csv")):
            if len(file.suffixes) == 1:  # neither inputs nor a truth
                yield folder, file


def real(work: Path) -> Iterator[tuple[Path, Path]]:
    """Plants with real recordings, as far as these are there; a folder takes what is cut out."""
    plants, shared = ROOT / "plants", recordings_folder()
    if (shared / HSY).exists():
        yield plants / "hsy-pumping", shared / HSY
    if (shared / esp.FOLDER).is_dir():
        for impeller in esp.IMPELLERS:
            for chosen in (esp.of_water, esp.of_glycerin):
                file = work / f"{impeller} {chosen.__name__}.csv"
                esp.write_points(shared / esp.FOLDER, impeller, chosen, file)
                yield plants / "esp-pump" / f"{impeller.lower()}.yaml", file
    if (shared / ZEMA).is_dir():
        file = work / "zema.csv"
        zema.write_cycles(shared / ZEMA, set(CYCLES), file)
        for name in zema.PLANTS.values():
            yield plants / "zema-hydraulic" / name, file
