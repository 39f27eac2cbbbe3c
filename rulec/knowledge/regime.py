"""Regimes: ways in which a module runs that its laws for delivering do not cover."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from rulec.language.expression import Expression
from rulec.language.origin import Origin


@dataclass(frozen=True)
class Comparison:
    """A condition of a regime, `text` as its author wrote it.

    With a `signal` its reading lies above its minimum, or below it. Else `margin`, in SI, must be
    positive beyond its uncertainty.
    """

    text: str
    margin: Expression
    signal: str = ""
    above: bool = False


@dataclass(frozen=True, kw_only=True)
class Regime:
    """A way in which a module runs, with all the conditions that must hold."""

    name: str
    title: str
    when: tuple[Comparison, ...]
    status: str
    text: str
    action: str
    origin: Origin

    def stands_on(self, names: Collection[str]) -> bool:
        """Are all names in its conditions among these?"""
        found = {name for c in self.when for name, _ in c.margin.names()}
        return found | {c.signal for c in self.when if c.signal} <= set(names)
