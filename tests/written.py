"""Files that tests write, plants and recordings, and what a command writes."""

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rulec.cli import main

KB = Path(__file__).parent.parent / "kb" / "modules"


def write_plant(
    folder: Path, modules: Mapping[str, str], connections: str = "", **more: object
) -> Path:
    """A folder with a plant: the type of each module, or what else its braces hold behind it."""
    listed = "".join(f"  {name}: {{type: {kind}}}\n" for name, kind in modules.items())
    text = f"plant: made-up\ntitle: Made up\nmodules:\n{listed}connections: [{connections}]\n"
    text += "".join(f"{key}: {value}\n" for key, value in more.items())
    folder.mkdir(exist_ok=True)
    (folder / "plant.yaml").write_text(text, encoding="utf-8")
    return folder


def write_exact(folder: Path) -> Path:
    """A plant of shipped types whose laws hold exactly, as those of simulated recordings do."""
    file, modules = folder / "plant.yaml", {}
    plant = yaml.safe_load(file.read_text(encoding="utf-8"))
    for name, module in plant["modules"].items():
        kind = yaml.safe_load((KB / f"{module['type']}.yaml").read_text(encoding="utf-8"))
        misfit = {observer: {"value": 0, "unit": "l/h"} for observer in kind["observers"]}
        modules[name] = {"type": module["type"], "misfit": misfit}
    calibration = {"calibration": plant["plant"], "modules": modules}
    (folder / "exact.yaml").write_text(yaml.safe_dump(calibration), encoding="utf-8")
    plant["calibration"] = ["exact.yaml", *plant.get("calibration", ())]
    file.write_text(yaml.safe_dump(plant, sort_keys=False), encoding="utf-8")
    return folder


def write_columns(file: Path, columns: Mapping[str, object]) -> Path:
    """A recording in CSV, by the titles of its columns."""
    rows = np.column_stack([np.asarray(column, dtype=float) for column in columns.values()])
    np.savetxt(file, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    return file


def read_columns(file: Path) -> dict[str, Any]:
    """Numbers of a table in CSV by the titles of its columns; NaN where a cell is empty."""
    import pandas as pd  # half a second, for few tests

    return {title: column.to_numpy(dtype=float) for title, column in pd.read_csv(file).items()}


def json_of(*words: object, code: int = 0) -> Any:
    """The JSON of a command."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "told.json"
        assert code == main([*map(str, words), "--json", str(file)])
        return json.loads(file.read_text(encoding="utf-8"))
