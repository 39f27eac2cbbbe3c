"""What a mismatch left standing, read from its JSON form."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rulec.effects.made_from import AGAIN
from rulec.mismatch.candidate_sets import Presence, Standing
from rulec.mismatch.refused import ExperimentRefused


def standing_of(data: Mapping[str, Any], file: Path) -> tuple[Standing, ...]:
    """What a mismatch left standing; `file` is its name. Raises ExperimentRefused where it does not
    say."""
    try:
        found = tuple(_one(one) for one in data["standing"])
    except (LookupError, TypeError, ValueError, AttributeError):
        raise ExperimentRefused(
            f"{file}: it does not say which explanations stand; {AGAIN}"
        ) from None
    if not found:
        raise ExperimentRefused(
            f"{file}: no sets of explanations were weighed. In plants that store they are not; a "
            "recording that cannot be judged has none"
        )
    return found


def _one(data: dict[str, Any]) -> Standing:
    return Standing(
        names=tuple(str(name) for name in data["names"]),
        titles=tuple(str(title) for title in data["titles"]),
        probability=float(data["probability"]),
        joined=tuple(str(id_) for id_ in data["joined"]),
        values={str(name): float(value) for name, value in data["values"].items()},
        fixed={str(name): float(value) for name, value in data["fixed"].items()},
        periods=tuple(
            Presence(
                str(p["unknown"]),
                tuple((float(a), float(b), int(level)) for a, b, level in p["spans"]),
                bool(p["grows"]),
            )
            for p in data["periods"]
        ),
        terms=tuple((str(name), float(length)) for name, length in data["terms"]),
    )
