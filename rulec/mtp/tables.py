"""Tables of the standard and of makers' habits, from the YAML files of this folder."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

_FOLDER = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class Tables:
    """`codes` and `spellings` are those of units; the head of each key in kinds.yaml explains the
    others."""

    codes: Mapping[str, str]
    spellings: Mapping[str, str]
    classes: Mapping[str, str]
    values: Mapping[str, Sequence[Mapping[str, Any]]]
    listed: Mapping[str, str]
    letters: Mapping[str, str]
    words: Mapping[str, Sequence[str]]
    first: Sequence[str]
    sensors: Mapping[str, Sequence[str]]
    equipment: Mapping[str, str]
    limits: Sequence[str]


@functools.cache
def tables() -> Tables:
    """All tables, read once."""
    units, kinds = _read("unit_codes.yaml"), _read("kinds.yaml")
    codes = {str(code): text for code, text in units["codes"].items()}
    roles = {name: role for role, names in kinds["classes"].items() for name in names}
    return Tables(codes=codes, spellings=units["spellings"], **{**kinds, "classes": roles})


def _read(name: str) -> Any:
    loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.load((_FOLDER / name).read_text(encoding="utf-8"), Loader=loader)
