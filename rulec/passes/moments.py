"""Covariances between observers, targets of faults, and slopes; each is built once.

A residual at the end of a long plant sums many observers, but only those that share an input with
a fault's module can correlate with it. An index of inputs finds them, so the effort per rule does
not grow with the plant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

from rulec.algebra.graph import Node
from rulec.passes.assemble import Assembly, Gradient, combine, covariance
from rulec.passes.derive_residuals import Residual
from rulec.passes.limits import LONG_SUM, MANY_CORRELATED

Signed = list[tuple[int, Gradient]]
"""A signed sum of gradients."""


class Moments:
    """Second moments over the gradients of an assembly."""

    def __init__(self, residuals: Sequence[Residual], assembly: Assembly) -> None:
        self._assembly, self._graph = assembly, assembly.graph
        self._signs = {r.id: {o: s for s, o in r.terms} for r in residuals}
        self._known: dict[tuple[int, int], Node] = {}
        self._related: dict[int, frozenset[str]] = {}
        self._sums: dict[tuple[tuple[int, int], ...], Gradient] = {}

    def gathered(self, gradients: Signed) -> Signed:
        """Combine a long sum to one gradient, so that products do not grow with its square."""
        if len(gradients) <= LONG_SUM:
            return gradients
        key = tuple((s, id(g)) for s, g in gradients)
        if key not in self._sums:
            self._sums[key] = combine(self._graph, gradients)
        return [(1, self._sums[key])]

    def of(self, a: Gradient, b: Gradient) -> Node:
        """Covariance of two gradients; the tables themselves are the key."""
        key = (id(a), id(b))
        node = self._known.get(key)
        if node is None:
            node = self._known[key] = covariance(self._graph, a, b)
        return node

    def with_residual(self, residual: str, gradients: Signed) -> Node:
        """Covariance of a residual with a signed sum of gradients."""
        signs, whole = self._signs[residual], self._assembly.residual_gradients[residual]
        terms: list[tuple[int, Node]] = []
        for sign, gradient in gradients:
            shared = self._correlated(gradient) & signs.keys()
            if len(shared) > MANY_CORRELATED:
                terms.append((sign, self.of(gradient, whole)))
                continue
            for observer in sorted(shared):
                node = self.of(self._assembly.gradients[observer], gradient)
                terms.append((sign * signs[observer], node))
        return self._graph.signed_sum(terms)

    def between(self, first: Signed, second: Signed) -> Node:
        """Covariance of two signed sums of gradients."""
        return self._graph.signed_sum((s * t, self.of(a, b)) for s, a in first for t, b in second)

    @cached_property
    def _readers(self) -> Mapping[str, frozenset[str]]:
        """Observers by the inputs they depend on."""
        found: dict[str, set[str]] = {}
        for observer, gradient in self._assembly.gradients.items():
            for name in gradient:
                found.setdefault(name, set()).add(observer)
        return {name: frozenset(observers) for name, observers in found.items()}

    def _correlated(self, gradient: Gradient) -> frozenset[str]:
        """Observers that share an input with a gradient."""
        known = self._related.get(id(gradient))
        if known is None:
            parts = [self._readers.get(name, frozenset()) for name in gradient]
            known = self._related[id(gradient)] = frozenset().union(*parts)
        return known
