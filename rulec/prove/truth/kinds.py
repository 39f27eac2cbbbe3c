"""Kinds of cases, from `cases.yaml`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

STATED: Mapping[str, Any] = yaml.safe_load(
    Path(__file__).with_name("cases.yaml").read_text(encoding="utf-8")
)


def counts(half: str, run: str) -> dict[str, int]:
    """Return the number of cases by group, of a run such as `full`, `half` of it."""
    return {group: stated[run] for group, stated in STATED[half].items() if run in stated}


def difficulties(half: str, group: str) -> tuple[str, ...]:
    """Return what makes a group harder, by the names of `cases.yaml`."""
    return tuple(STATED[half].get(group, {}).get("difficulties", ()))


def masked_pairs(half: str) -> list[tuple[str, ...]]:
    """Return pairs of effects that hide each other."""
    return [tuple(pair) for pair in STATED["hiding"][half]]
