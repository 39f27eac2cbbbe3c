"""Effects that an equation may leave out: checked entries of the catalogue, in SI."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rulec.knowledge.module_type import Stored
from rulec.language.diagnostics import Origin
from rulec.language.expression import (
    Expression,
    Rejected,
    checked,
    function_of,
    name_node,
    rejected_at,
    syntax_tree,
)
from rulec.language.units import Unit

USUAL_HINT = "add 'usual: {median: ..., factor: 3, source: ...}', or 'change: 0.05' for a share"
"""Remedy for a missing usual size."""


@dataclass(frozen=True)
class Usual:
    """The usual size of an amplitude: its distance from the null, SI.

    If `of_place`, `size` is instead the share by which the place usually changes. `factor` is the
    geometric standard deviation.
    """

    size: float
    factor: float
    of_place: bool


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Prior knowledge of an unknown parameter; numbers in SI.

    At `null` the plain law holds, whatever the other parameters; None for a parameter that only
    shapes the term (a threshold, an exponent). `starts` are values to try, `quantiles` quantiles of
    the readings of `driver` to try. A `fixed` parameter is not unknown, but a typical reading of
    `driver`; if it is `neutral`, the plain law holds at that reading, whatever the other
    parameters. `usual` is the usual size of a parameter with a null.
    """

    name: str
    title: str
    null: float | None = None
    lowest: float = -math.inf
    highest: float = math.inf
    starts: tuple[float, ...] = ()
    quantiles: tuple[float, ...] = ()
    driver: str | None = None
    fixed: bool = False
    neutral: bool = False
    usual: Usual | None = None


def usual_of(part: Mapping[str, Any], unit: Unit | None = None) -> Usual | None:
    """The usual size that a parameter or a degree states; shares of a place have no unit."""
    stated = part.get("usual")
    if stated is None:
        return None
    if "change" in stated:
        return Usual(float(stated["change"]), float(stated["factor"]), of_place=True)
    # A size is a difference from the null, so the offset of a unit does not apply.
    factor = 1.0 if unit is None else unit.factor
    return Usual(abs(stated["median"]) * factor, float(stated["factor"]), of_place=False)


PLAIN = "law"
"""Name of the plain law, without the effect, in the law of an effect."""


@dataclass(frozen=True)
class Driver:
    """A reading that an effect depends on, by quantity.

    `where` is ``own`` (a signal of the module), ``read`` (an own signal that no state gives),
    ``unread`` (an own signal that no equation reads), ``beside`` (an own signal, if the equation
    of the place reads none of its quantity), ``plant`` (an own signal, else one of any module) or
    ``downstream`` (a signal of the next module, as in ``downstream(name)``). The quantity ``time``
    means seconds since the start of the recording.
    """

    name: str
    quantity: str
    where: str
    title: str


@dataclass(frozen=True, kw_only=True)
class EffectParameter(Shape):
    """A parameter of an effect; a `fixed` one stays at the median reading of `driver`.

    One `of_place` is a reading of the signal that the effect joins, or a difference of its readings
    per some unit: its numbers are in the unit of that signal, times `unit`.
    """

    unit: Unit
    of_place: bool = False

    def at(self, reading: Unit, difference: Unit) -> EffectParameter:
        """The parameter at a signal, in SI; `difference` is the unit of differences of readings."""
        if not self.of_place:
            return self
        unit = reading if self.null is None and self.unit.text == PLAIN else difference
        usual = self.usual
        if usual is not None and not usual.of_place:
            usual = replace(usual, size=usual.size * unit.factor)
        return replace(
            self,
            unit=Unit(
                unit.text + self.unit.text.removeprefix(PLAIN),
                unit.factor * self.unit.factor,
                unit.dimension * self.unit.dimension,
                unit.offset,
            ),
            null=None if self.null is None else unit.to_si(self.null),
            lowest=unit.to_si(self.lowest),
            highest=unit.to_si(self.highest),
            starts=tuple(unit.to_si(start) for start in self.starts),
            usual=usual,
            of_place=False,
        )


@dataclass(frozen=True, kw_only=True)
class Join:
    """A kind of place that an effect can join, and its law there.

    Exactly one of these is set: `reads` (a signal of this quantity, or ``any``), `gives` (a
    definition or observer of this quantity), and in modules that store, `stores` (the derivative of
    a state of this quantity), `shows` (what a sensor of this quantity shows, or ``any``), `flows`
    (``in`` or ``out``).

    `falls_with` and `rises_with` name a driver; the slope by it at the reference point must have
    that sign. `steep`: if that driver rises by a share, the result changes by more (True) or less
    (False) than half that share; None: either. With `measured`, only places that read a signal of
    the quantity they give (a processed reading) are joined; without it, only others. A place that
    gives a flow is joined only if an estimate of the module's flow rises with it: a slip, which is
    subtracted, is no estimate.

    `law` may use ``law``, ``law(driver=...)``, drivers and parameters. A join needs only those that
    occur there, in `falls_with` or `rises_with`, or as the `driver` of such a parameter. `also`
    gives the flow ``in`` or ``out`` a law in addition.
    """

    reads: str = ""
    gives: str = ""
    falls_with: str = ""
    rises_with: str = ""
    measured: bool = False
    law: EffectLaw
    steep: bool | None = None
    stores: str = ""
    shows: str = ""
    flows: str = ""
    also: Mapping[str, EffectLaw] = field(default_factory=dict)

    @property
    def laws(self) -> tuple[EffectLaw, ...]:
        """The law of the place, then those of `also`."""
        return (self.law, *self.also.values())


@dataclass(frozen=True)
class EffectLaw:
    """The law of a place: `expression` over drivers, parameters, ``law`` and `substitutes`.

    Each distinct ``law(dp=0)`` is the name of an entry of `substitutes`, which maps drivers of the
    plain law to what replaces them.
    """

    text: str
    expression: Expression
    substitutes: Mapping[str, Mapping[str, Expression]]

    def names(self) -> set[str]:
        """Drivers and parameters that it uses, including those in ``law(...)``."""
        found = {name for name, _ in self.expression.names()} - {PLAIN, *self.substitutes}
        for replaced in self.substitutes.values():
            found |= replaced.keys()
            found |= {name for value in replaced.values() for name, _ in value.names()}
        return found


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Physics, ageing or a sensor error (`sort`) that a relation may leave out.

    Its `states` have the dimension of its place; their equations may use what its law may.
    """

    name: str
    title: str
    sort: str
    joins: tuple[Join, ...]
    drivers: Mapping[str, Driver]
    parameters: Mapping[str, EffectParameter]
    text: str
    action: str
    origin: Origin
    states: Mapping[str, Stored] = field(default_factory=dict)

    def used_by(self, join: Join) -> set[str]:
        """Drivers and parameters that a join uses, directly or through states."""
        found = {name for law in join.laws for name in law.names()}
        found |= {name for state in self.states.values() for name in state.names()}
        return found - {PLAIN, *self.states}

    def needed_by(self, join: Join) -> set[str]:
        """Drivers and parameters that a join uses or needs for its slopes or typical readings."""
        names = self.used_by(join) | {n for n in (join.falls_with, join.rises_with) if n}
        names |= {p.driver for n, p in self.parameters.items() if n in names and p.driver}
        return names - {PLAIN}


# Read the law of an effect: an equation that may use the plain law at another point.
#
# ``law(dp=0)`` is the plain law with a driver replaced. Each distinct one gets a name of its own.

_ELSEWHERE = re.compile(rf"\b{PLAIN}\s*\(")
_NUMBERED = re.compile(rf"\b{PLAIN}_[0-9]+\b")
_EXAMPLE = f"as in {PLAIN}(dp=0)"


def parse_law(text: str) -> EffectLaw:
    """Read the law of an effect; raises `Rejected` for anything outside the language.

    >>> law = parse_law("law(dp=0) - c*(law(dp=0) - law)")
    >>> law.expression.text
    'law_1 - c*(law_1 - law)'
    >>> law.substitutes["law_1"]["dp"].text
    '0'
    """
    numbered = _NUMBERED.search(text)
    if numbered:
        message = f"'{numbered[0]}' is neither driver nor parameter of this effect"
        raise Rejected("KB036", numbered.start(), message, _EXAMPLE, len(numbered[0]))
    named = _Elsewhere()
    tree = named.visit(syntax_tree(text, also="=" if _ELSEWHERE.search(text) else ""))
    return EffectLaw(text, checked(tree), named.substitutes)


class _Elsewhere(ast.NodeTransformer):
    """Replaces each distinct ``law(...)`` by a name, and holds its `substitutes` by that name."""

    def __init__(self) -> None:
        self.substitutes: dict[str, dict[str, Expression]] = {}
        self._names: dict[str, str] = {}

    def visit_Call(self, node: ast.Call) -> ast.AST:
        if function_of(node) != PLAIN:
            return self.generic_visit(node)
        text = ast.unparse(node)
        if text not in self._names:
            self._names[text] = name = f"{PLAIN}_{len(self._names) + 1}"
            self.substitutes[name] = _replaced(node)
        return ast.copy_location(name_node(self._names[text]), node)


def _replaced(call: ast.Call) -> dict[str, Expression]:
    """Per driver what replaces it; raises `Rejected`."""
    given = {part.arg: part.value for part in call.keywords if part.arg}
    if call.args or not given or len(given) < len(call.keywords):
        message = f"{PLAIN}(...) takes each driver once, with what replaces it"
        parts: list[ast.expr | ast.keyword] = [*call.args, *call.keywords, call]
        raise rejected_at(parts[0], "KB045", message, _EXAMPLE)
    for inner in (inner for value in given.values() for inner in ast.walk(value)):
        if isinstance(inner, ast.Call) and function_of(inner) == PLAIN:
            message = f"{PLAIN}(...) cannot stand inside another"
            raise rejected_at(inner, "KB045", message, _EXAMPLE)
    return {driver: checked(value) for driver, value in given.items()}
