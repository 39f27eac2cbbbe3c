"""Tables of the standard and of makers' habits, from the YAML files of this folder."""

import functools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import yaml

_FOLDER = Path(__file__).parent


@functools.cache
def tables() -> Any:
    """All tables, read once: `codes` and `spellings` are those of units; the head of each key in
    kinds.yaml explains the others, and `classes` gives the role of each class."""
    units, kinds = _read("unit_codes.yaml"), _read("kinds.yaml")
    codes = {str(code): text for code, text in units["codes"].items()}
    roles = {name: role for role, names in kinds["classes"].items() for name in names}
    return SimpleNamespace(codes=codes, spellings=units["spellings"], **{**kinds, "classes": roles})


def _read(name: str) -> Any:
    loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.load((_FOLDER / name).read_text(encoding="utf-8"), Loader=loader)
