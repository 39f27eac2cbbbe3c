"""A fleet: which plants, judged by which rulesets, with recordings at which place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """What a fleet file says.

    Attributes
    ----------
    recordings : folder, or address of one elsewhere, as ``s3://bucket/recordings``.
    plant_key, day_key : names of the partitions, as in ``plant=P1/day=2026-01-01/``.
    results : folder of results.
    rulesets : text of each ruleset by its hash.
    judged_by : folder of the plant, or its ruleset file, that each ruleset is of, by its hash.
    titles : whether the fleet names columns.
    plants : hash of the ruleset of each plant; of one that is not named, `default` counts.
    only_named : whether plants that are not named are left out.
    first, last : days, ISO 8601; empty where there is no end.
    trace : whether every sample is judged.
    """

    name: str
    title: str
    recordings: str
    plant_key: str
    day_key: str
    results: Path
    rulesets: Mapping[str, str]
    judged_by: Mapping[str, str]
    titles: bool
    plants: Mapping[str, str]
    default: str
    only_named: bool
    first: str
    last: str
    trace: bool
