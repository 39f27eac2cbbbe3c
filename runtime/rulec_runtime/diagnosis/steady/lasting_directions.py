"""Errors that last, as few as tell estimates apart, where a plant has hundreds of estimates.

A dozen errors that only the estimates of one module read act on two or three of them. At all
operating points of a recording they do so nearly in the same way, so a few directions among them
say what is known of all. What else there is of an error is taken as new at every point: its
variance counts in full, that it lasts does not.

Source: singular value decomposition (Eckart and Young 1936).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

Gradients = dict[str, dict[int, Array]]
"""Per error the observers (places) that it reaches: derivative times standard uncertainty, m3/s,
shape (n,)."""


@dataclass(frozen=True)
class Directions:
    """Per module the errors that its estimates alone read, and directions among them that last,
    orthonormal, shape (errors, directions)."""

    modules: Mapping[str, tuple[tuple[str, ...], Array]]

    def split(self, gradients: Gradients) -> tuple[Gradients, Gradients]:
        """Gradients by directions and by errors that no module has alone, and what is left."""
        joined = {error for errors, _ in self.modules.values() for error in errors}
        lasting = {error: own for error, own in gradients.items() if own and error not in joined}
        left: Gradients = {}
        for module, (errors, directions) in self.modules.items():
            places, table = _table(gradients, errors)
            kept = np.einsum("oen,ek->okn", table, directions)
            rest = table - np.einsum("okn,ek->oen", kept, directions)
            for k in range(directions.shape[1]):
                lasting[f"{module}:{k}"] = dict(zip(places, kept[:, k], strict=True))
            for k, error in enumerate(errors):
                left[error] = dict(zip(places, rest[:, k], strict=True))
        return lasting, left


def directions_of(ruleset: Ruleset, gradients: Gradients) -> Directions:
    """Directions that hold nearly all of the variance by gradients at some points."""
    owner = [observer.module for observer in ruleset.observers]
    modules: dict[str, list[str]] = {}
    for error, own in gradients.items():
        readers = {owner[place] for place in own}
        if len(readers) == 1:
            modules.setdefault(readers.pop(), []).append(error)
    return Directions({m: (tuple(own), _directions(gradients, own)) for m, own in modules.items()})


def _directions(gradients: Gradients, errors: list[str]) -> Array:
    _, table = _table(gradients, tuple(errors))
    rows = np.moveaxis(np.nan_to_num(table, posinf=0.0, neginf=0.0), 1, -1).reshape(-1, len(errors))
    _, sizes, directions = np.linalg.svd(rows, full_matrices=False)
    behind = np.append(np.cumsum(sizes[::-1] ** 2)[::-1], 0.0)
    enough = int(np.argmax(behind <= limits.LEFT_OF_ERRORS * behind[0]))
    found: Array = directions[:enough].T
    return found


def _table(gradients: Gradients, errors: tuple[str, ...]) -> tuple[list[int], Array]:
    """Observers that some errors reach, and gradients, shape (observers, errors, n)."""
    places = sorted({place for error in errors for place in gradients[error]})
    n = len(next(iter(gradients[errors[0]].values()))) if places else 0
    table = np.zeros((len(places), len(errors), n))
    for k, error in enumerate(errors):
        for place, gradient in gradients[error].items():
            table[places.index(place), k] = gradient
    return places, table
