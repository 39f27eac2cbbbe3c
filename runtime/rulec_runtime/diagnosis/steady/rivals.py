"""Which other causes stand beside the one that is named.

What the readings cannot tell from it does, however seldom it comes; and so does what is about as
probable.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from rulec_runtime import limits

Name = TypeVar("Name", int, str)


@dataclass(frozen=True)
class Other(Generic[Name]):
    """A cause with its probability, and with that if all faults came equally often."""

    name: Name
    probability: float
    unprejudiced: float


def rivals_of(
    named: Other[Name], others: Iterable[Other[Name]]
) -> tuple[tuple[tuple[Name, float], ...], tuple[tuple[Name, float], ...]]:
    """Rivals of a cause, and remote ones, each with its probability, the most probable first."""
    rivals: list[tuple[Name, float]] = []
    remote: list[tuple[Name, float]] = []
    for other in sorted(others, key=lambda o: -o.probability):
        if max(other.probability, other.unprejudiced) > limits.MENTION:
            stands = (
                other.probability >= limits.RIVAL * named.probability
                or other.unprejudiced >= limits.RIVAL * named.unprejudiced
            )
            (rivals if stands else remote).append((other.name, other.probability))
    return tuple(rivals), tuple(remote)
