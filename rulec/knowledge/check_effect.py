"""Check an effect: names, parameters, and laws that can be switched off."""

import math
import random
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rulec_runtime.output.nearest import did_you_mean

from rulec.knowledge.check_join import TIME, JoinReader
from rulec.knowledge.effect import (
    PLAIN,
    USUAL_HINT,
    Driver,
    Effect,
    EffectParameter,
    Join,
    usual_of,
)
from rulec.knowledge.limits import EFFECT_TOLERANCE, EFFECT_TRIES, TRIED_READINGS
from rulec.knowledge.module_type import Stored
from rulec.language.expression import Rejected, constant
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader
from rulec.language.units import NONE, SECOND, UNKNOWN, Dimension, Unit

SLOTS = ("module", "place")
"""Slots that the text of every effect may use."""

_SLOT = re.compile(r"\{([^{}:]*)(:%)?\}")
_OF_FREE = ("unit", "null", "starts", "driver", "range")
_OF_PLACE = re.compile(rf"{PLAIN}(?=$|[*/])")


@dataclass
class EffectReader(Reader):
    """Reads one effect document; `known` holds the dimensions of drivers and parameters."""

    known: dict[str, Dimension] = field(default_factory=dict)

    def read(self) -> Effect:
        """The effect, in SI."""
        data, before = self.document.data, len(self.found)
        groups = ("drivers", "parameters", "states")
        numbered = (n for g in groups for n in self._group(g) if n.startswith(f"{PLAIN}_"))
        self.check_own_names(groups, (PLAIN, *SLOTS, *numbered))
        # A law that uses a refused name would report the same mistake again.
        of_laws = self.found if len(self.found) == before else []
        drivers = {name: self._driver(name, part) for name, part in self._group("drivers").items()}
        parameters = {
            name: self._parameter(name, part, drivers) for name, part in data["parameters"].items()
        }
        states = {name: self._state(name) for name in self._group("states")}
        of_place = {n: p.unit.dimension for n, p in parameters.items() if p.of_place}
        reader = JoinReader(
            self.document, self.units, of_laws, drivers, self.known, states, of_place
        )
        joins = [(i, join) for i in range(len(data["joins"])) for join in reader.read(i)]
        effect = Effect(
            name=data["effect"],
            title=data["title"],
            sort=data["sort"],
            joins=tuple(join for _, join in joins),
            drivers=drivers,
            parameters=parameters,
            text=data["text"],
            action=data["action"],
            origin=self.origin("effect", source=data["source"]),
            states=states,
        )
        if len(self.found) == before:
            self._check_used(effect, joins)
            self._check_text(effect)
            self._check_null(effect, joins)
        if len(self.found) == before:
            self._check_usual(effect)
        if len(self.found) > before:
            return effect
        # A parameter with two quantiles is a distance between readings, not one of them.
        neutral = {
            name: parameter.fixed and len(parameter.quantiles) < 2 and is_neutral(effect, name)
            for name, parameter in parameters.items()
        }
        judged = {name: replace(p, neutral=neutral[name]) for name, p in parameters.items()}
        return replace(effect, parameters=judged)

    def _group(self, name: str) -> Mapping[str, Any]:
        part: Mapping[str, Any] = self.document.data.get(name, {})
        return part

    def _driver(self, name: str, part: Mapping[str, Any]) -> Driver:
        quantity = part["quantity"]
        own = SECOND
        if quantity != TIME:
            own = self.quantity("drivers", name, "quantity", also=(TIME,)) or UNKNOWN
        self.known[name] = own
        return Driver(name, quantity, part.get("where", "own"), part.get("title", quantity))

    def _state(self, name: str) -> Stored:
        """A state of the effect; unknown names in its equations are reported."""
        known = {PLAIN, *self.known, *self._group("states")}
        equations = {}
        for key in self._group("states")[name]:
            path = ("states", name, key)
            equations[key] = self.expression(*path)
            what = "driver, parameter nor state of this effect"
            self.check_names(path, equations[key], known, what)
        return Stored(rate=equations.pop("der"), **equations)

    def _asked(self, path: Path_, name: str, drivers: Mapping[str, Driver]) -> str | None:
        """The driver that a parameter names; an unknown one is reported and gives None."""
        if name in drivers:
            return name
        hint = did_you_mean(name, drivers)
        self.report(path, "KB102", f"there is no driver '{name}'", hint)
        return None

    def _parameter(
        self, name: str, part: Mapping[str, Any], drivers: Mapping[str, Driver]
    ) -> EffectParameter:
        path = ("parameters", name)
        if "of" in part:
            return self._fixed(name, part, drivers)
        unit = self._unit(path) if "unit" in part else Unit("1", 1.0, UNKNOWN)
        of_place = "unit" in part and bool(_OF_PLACE.match(part["unit"]))
        self.known[name] = UNKNOWN if of_place else unit.dimension
        lacking = [key for key in ("unit", "range") if key not in part]
        lacking += [] if "starts" in part or "quantiles" in part else ["starts"]
        if lacking:
            message = f"the parameter '{name}' needs {' and '.join(map(repr, lacking))}"
            hint = "or 'of: ...' alone, for the median reading of a driver"
            self.report_key(path, "KB103", message, hint)
        low, high = part.get("range", (-math.inf, math.inf))
        self._check_inside(path, part, low, high)
        null = part.get("null")
        return EffectParameter(
            name=name,
            title=part["title"],
            unit=unit,
            null=None if null is None else unit.to_si(null),
            lowest=unit.to_si(low),
            highest=unit.to_si(high),
            starts=tuple(unit.to_si(start) for start in part.get("starts", ())),
            quantiles=tuple(part.get("quantiles", ())),
            driver=self._quantiles(path, part, drivers, unit),
            usual=usual_of(part, unit),
            of_place=of_place,
        )

    def _unit(self, path: Path_) -> Unit:
        """The unit of a parameter; ``law`` stands for the unit of the signal that is joined."""
        text = self.part((*path, "unit"))
        of_place = _OF_PLACE.match(text)
        if of_place is None:
            return self.unit(*path, "unit")
        if not self._joins_signals():
            message = f"'{PLAIN}' is no unit where the effect joins equations"
            self.report((*path, "unit"), "KB103", message, "take a unit from kb/units.yaml")
        try:
            rest = self.units.parse(f"1{text[of_place.end() :]}")
        except ValueError as error:
            hint = "the spellings are in kb/units.yaml"
            self.report((*path, "unit"), "KB050", f"there is no unit '{error}'", hint)
            rest = Unit("1", 1.0, NONE)
        return replace(rest, text=text)

    def _joins_signals(self) -> bool:
        """Whether it joins only signals or what sensors show."""
        return all({"reads", "shows"} & join.keys() for join in self.document.data["joins"])

    def _fixed(
        self, name: str, part: Mapping[str, Any], drivers: Mapping[str, Driver]
    ) -> EffectParameter:
        """A parameter fixed at the median of a driver's readings, or at their spread."""
        odd = [key for key in _OF_FREE if key in part]
        if odd:
            message = f"'{name}' is the median reading of a driver; it has no '{odd[0]}'"
            hint = "remove it, or remove 'of'"
            self.report_key(("parameters", name, odd[0]), "KB103", message, hint)
        quantiles = tuple(part.get("quantiles", ()))
        if len(quantiles) > 2:
            message, hint = "a spread is that between two quantiles", "give two, as [0.05, 0.95]"
            self.report_key(("parameters", name, "quantiles"), "KB103", message, hint)
        of_place = part["of"] == PLAIN and self._joins_signals()
        driver = PLAIN if of_place else self._asked(("parameters", name, "of"), part["of"], drivers)
        self.known[name] = own = self.known.get(driver or "", UNKNOWN)
        return EffectParameter(
            name=name,
            title=part["title"],
            unit=Unit(PLAIN, 1.0, NONE) if of_place else self.units.plain(own),
            quantiles=quantiles,
            driver=driver,
            fixed=True,
            of_place=of_place,
        )

    def _check_inside(self, path: Path_, part: Mapping[str, Any], low: float, high: float) -> None:
        """Check the range, and that null and starts lie in it."""
        before = len(self.found)
        self.check_range(low, high, *path, "range")
        values: list[tuple[Path_, float]] = []
        values += [((*path, "starts", i), v) for i, v in enumerate(part.get("starts", ()))]
        values += [((*path, "null"), part["null"])] if "null" in part else []
        for where, value in values if len(self.found) == before else ():
            if not low <= value <= high:
                message = f"{value:g} is outside of the range"
                self.report(where, "KB104", message, f"from {low:g} to {high:g}")

    def _quantiles(
        self, path: Path_, part: Mapping[str, Any], drivers: Mapping[str, Driver], unit: Unit
    ) -> str | None:
        """The driver whose quantiles are tried; it must have the parameter's dimension.

        If the effect joins signals, the driver may be ``law``, the reading of that signal.
        """
        tried = "quantiles" in part
        if tried != ("driver" in part) or (tried and "starts" in part):
            message = f"'{path[-1]}' needs 'starts', or else 'quantiles' and their 'driver'"
            self.report_key(path, "KB103", message, "one of the two")
            return None
        if "driver" not in part:
            return None
        if part["driver"] == PLAIN and self._joins_signals():
            return PLAIN
        driver = self._asked((*path, "driver"), part["driver"], drivers)
        if driver and not self.known[driver].fits(unit.dimension):
            message = f"'{unit.text}' is not a unit of {drivers[driver].quantity}"
            hint = self.units.like(self.known[driver])
            self.report((*path, "unit"), "KB053", message, hint)
        return driver

    def _check_used(self, effect: Effect, joins: list[tuple[int, Join]]) -> None:
        """Check that each law uses all free parameters, and some law each driver and fixed one."""
        used = [effect.needed_by(join) for _, join in joins]
        everywhere, somewhere = set.intersection(*used), set().union(*used)
        for name, parameter in effect.parameters.items():
            path = ("parameters", name)
            if name not in somewhere:
                message = f"no law uses the parameter '{name}'"
                self.report_key(path, "KB038", message, "remove it or use it")
            elif not (parameter.fixed or name in everywhere):
                message = f"a law does not use the parameter '{name}'"
                self.report_key(path, "KB038", message, "each law needs it; or make two effects")
        for name in effect.drivers:
            if name not in somewhere:
                message = f"nothing uses the driver '{name}'"
                self.report_key(("drivers", name), "KB038", message, "remove it or use it")

    def _check_text(self, effect: Effect) -> None:
        """Check that the slots of the text are known wherever the effect joins."""
        needed = (effect.needed_by(join) for join in effect.joins)
        known, text = set.intersection(*needed), effect.text
        if re.search("[{}]", _SLOT.sub("", text)):
            message, hint = "a brace in the text has no partner", "write slots as {module}"
            self.report(("text",), "KB107", message, hint)
        for slot in _SLOT.finditer(text):
            name = slot[1]
            if name not in known and name not in SLOTS:
                some = name in effect.drivers or name in effect.parameters
                message = f"{'not every join has' if some else 'there is no'} '{name}'"
                hint = did_you_mean(name, {*known, *SLOTS})
                self.report_word(("text",), slot.start(1), name, "KB107", message, hint)
            elif slot[2] and not (
                name in effect.parameters and effect.parameters[name].unit.text.startswith("1")
            ):
                message, hint = f"'{name}' is not a fraction", "':%' needs a unit such as 1 or 1/K"
                self.report_word(("text",), slot.start(1), name, "KB107", message, hint)

    def _check_null(self, effect: Effect, joins: list[tuple[int, Join]]) -> None:
        """Check that the law reduces to the plain law if all parameters are at their null."""
        if all(parameter.null is None for parameter in effect.parameters.values()):
            message = "this effect has no parameter with a 'null'; nothing switches it off"
            hint = "add 'null: 0' to the one that says how strong it is"
            self.report_key(("parameters",), "KB105", message, hint)
            return
        for i, join in dict(reversed(joins)).items():  # the first join of each entry
            reason = fails_at_null(effect, join)
            if reason:
                self.report(("joins", i, "law"), "KB106", reason, "check signs and 'null'")

    def _check_usual(self, effect: Effect) -> None:
        """Check that exactly the parameters with a null state a usual size."""
        for name, parameter in effect.parameters.items():
            part, path = self._group("parameters")[name], ("parameters", name)
            if parameter.null is not None and "usual" not in part:
                message = f"how large '{name}' usually is is missing"
                self.report_key(path, "KB108", message, USUAL_HINT)
            elif parameter.null is None and "usual" in part:
                message = f"'{name}' has no null, so no usual size"
                self.report((*path, "usual"), "KB108", message, "remove it, or add 'null'")
            elif parameter.usual is not None and not parameter.usual.size:
                message = "the usual size is nothing"
                self.report((*path, "usual", "median"), "KB108", message, "away from the null")


def fails_at_null(effect: Effect, join: Join) -> str:
    """Why the law differs from the plain law at the null of all parameters; "" if it does not."""
    undefined = 0
    for known, plain in _trials(effect, join, at_null=True):
        # States have settled at the plain law, which is also where they start.
        stored = dict.fromkeys(effect.states, plain[PLAIN])
        try:
            values = [constant(law.expression, {**known, **plain, **stored}) for law in join.laws]
        except Rejected:
            undefined += 1
            continue
        if not all(_is_plain(value, plain) for value in values):
            return "with all parameters at their null this does not give the plain law back"
    if undefined > EFFECT_TRIES // 2:
        return "with all parameters at their null this is mostly no number"
    return ""


def is_neutral(effect: Effect, name: str) -> bool:
    """Whether each join gives the plain law if a driver, or that law, equals a fixed parameter."""
    driver = effect.parameters[name].driver or ""
    used = [join for join in effect.joins if name in effect.used_by(join)]
    return bool(used) and all(
        _holds(effect, join, name, driver) or _holds(effect, join, name, PLAIN) for join in used
    )


def _holds(effect: Effect, join: Join, name: str, at: str) -> bool:
    judged = 0
    for known, plain in _trials(effect, join, equal={name: at}):
        try:
            value = constant(join.law.expression, {**known, **plain})
        except Rejected:
            continue
        if not _is_plain(value, plain):
            return False
        judged += 1
    return judged > EFFECT_TRIES // 2


def _is_plain(value: float | None, plain: Mapping[str, float]) -> bool:
    """Whether a value equals that of the plain law, except for rounding."""
    largest = max(map(abs, plain.values()))
    return value is not None and abs(value - plain[PLAIN]) <= EFFECT_TOLERANCE * largest


def _trials(
    effect: Effect, join: Join, at_null: bool = False, equal: Mapping[str, str] | None = None
) -> Iterator[tuple[dict[str, float], dict[str, float]]]:
    """Readings with parameters, and values of the plain laws there; the same in every call.

    Parameters in `equal` are at the reading of a driver, or at the plain law.
    """
    draw = random.Random(0)
    nulls = {n: p.null for n, p in effect.parameters.items() if p.null is not None}
    of_law = [n for n, p in effect.parameters.items() if p.driver == PLAIN]
    for _ in range(EFFECT_TRIES):
        known = readings(effect, draw)
        known |= parameters(effect, known, draw) | (nulls if at_null else {})
        known |= {name: known[at] for name, at in (equal or {}).items() if at in known}
        plain = plain_laws(join, known, draw)
        known |= {n: plain[PLAIN] * draw.uniform(0.5, 2.0) for n in of_law}
        known |= {name: plain[PLAIN] for name, at in (equal or {}).items() if at == PLAIN}
        yield known, plain


def readings(effect: Effect, draw: random.Random) -> dict[str, float]:
    """A reading of each driver, positive and of any order of magnitude."""
    return {name: math.exp(draw.uniform(*TRIED_READINGS)) for name in effect.drivers}


def parameters(effect: Effect, known: Mapping[str, float], draw: random.Random) -> dict[str, float]:
    """Parameters near the reading of their driver, the others anywhere in their range.

    Those that are readings of the joined signal itself are left out.
    """
    return {
        name: known[p.driver] * draw.uniform(0.5, 2.0)
        if p.driver
        else draw.uniform(p.lowest, p.highest)
        for name, p in effect.parameters.items()
        if p.driver != PLAIN
    }


def plain_laws(join: Join, known: Mapping[str, float], draw: random.Random) -> dict[str, float]:
    """Values of ``law`` and of each ``law(...)``: one smooth positive function of the drivers.

    A replacement of a driver that is no number counts as 0.
    """
    size = math.exp(draw.uniform(-7.0, 7.0))
    drivers = {name for replaced in join.law.substitutes.values() for name in replaced}
    bent = {name: (draw.uniform(-2.0, 2.0), abs(known[name]) or 1.0) for name in sorted(drivers)}

    def law(at: Mapping[str, float]) -> float:
        shapes = ((at[name], slope, scale) for name, (slope, scale) in bent.items())
        return size * math.exp(sum(slope * v / (abs(v) + scale) for v, slope, scale in shapes))

    result = {PLAIN: law(known)}
    for key, replaced in join.law.substitutes.items():
        there = dict(known)
        for name, value in replaced.items():
            try:
                there[name] = constant(value, known) or 0.0
            except Rejected:
                there[name] = 0.0
        result[key] = law(there)
    return result
