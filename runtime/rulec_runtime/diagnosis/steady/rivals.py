"""Alternatives to the named cause.

A cause that the readings cannot distinguish is a rival, however rare; so is one that is about as
probable. Unlisted errors are many, and each explains something a little worse: such a one is a
rival only if no reading contradicts it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from rulec_runtime.diagnosis.steady import limits

Name = TypeVar("Name", int, str)


@dataclass(frozen=True)
class Other(Generic[Name]):
    """A cause with its probability, and with that if all faults were equally frequent; `unlisted`
    if its module does not list it."""

    name: Name
    probability: float
    unprejudiced: float
    unlisted: bool = False


def rivals_of(
    named: Other[Name], others: Iterable[Other[Name]]
) -> tuple[tuple[tuple[Name, float], ...], tuple[tuple[Name, float], ...]]:
    """Rivals of a cause, and remote ones, each with its probability, the most probable first."""
    rivals: list[tuple[Name, float]] = []
    remote: list[tuple[Name, float]] = []
    for other in sorted(others, key=lambda o: -o.probability):
        share = limits.ALIKE if other.unlisted else limits.RIVAL
        stands = (
            other.probability >= limits.RIVAL * named.probability
            or other.unprejudiced >= share * named.unprejudiced
        )
        chances = (other.probability, 0.0 if other.unlisted and not stands else other.unprejudiced)
        if max(chances) > limits.MENTION:
            (rivals if stands else remote).append((other.name, other.probability))
    return tuple(rivals), tuple(remote)
