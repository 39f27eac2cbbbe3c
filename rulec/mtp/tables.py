"""What the standard and its makers' habits say, from the YAML files of this folder."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

_FOLDER = Path(__file__).parent
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True, kw_only=True)
class Tables:
    """`classes` gives the role of each class of data assemblies, `values` where a role keeps its
    value, `listed` the titles of the others; `letters`, `words` and `first` say what is measured,
    `sensors` with what, `equipment` what an ECLASS code begins with."""

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
    return yaml.load((_FOLDER / name).read_text(encoding="utf-8"), Loader=_LOADER)
