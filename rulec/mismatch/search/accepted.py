"""An explanation that won its round of the search."""

from __future__ import annotations

from dataclasses import dataclass

from rulec.mismatch.evidence.steady.screen import Trial
from rulec.mismatch.result import Rival


@dataclass(frozen=True)
class Accepted:
    """An explanation that won its round; `others` are those that came next, best first.

    `odds` are theirs against the winner.
    """

    trial: Trial
    gain: float
    rivals: tuple[Rival, ...]
    others: tuple[Trial, ...]
    odds: tuple[float, ...]
