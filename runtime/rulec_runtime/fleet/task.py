"""One plant on one day, as it is handed to a worker."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass

FORM = 3
"""Of what is told of a plant-day; another one makes all of them be judged again."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """A plant-day.

    Attributes
    ----------
    files : addresses of its recordings, in order of their names.
    marks : of each file size and time of change, by which it is known whether it is the same.
    ruleset : hash of the ruleset's text.
    trace : whether every sample is judged as well.
    """

    plant: str
    day: str
    files: tuple[str, ...]
    marks: tuple[str, ...]
    ruleset: str
    trace: bool

    @property
    def key(self) -> str:
        """The same where the same work gives the same result."""
        text = json.dumps([FORM, asdict(self)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def hash_of(ruleset: str) -> str:
    """By which the text of a ruleset is known."""
    return hashlib.sha256(ruleset.encode()).hexdigest()[:16]
