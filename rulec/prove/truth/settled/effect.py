"""Effects of a stationary plant, from `effects.yaml`, and what one of some size changes."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, get_args

import numpy as np
import yaml

from ..formulas import Drawn, Names
from ..units import BAR, LITRE_PER_HOUR, RPM, Array
from .drive import late
from .operated_plant import Scene
from .rig import PUMPS, PumpKind, Rig
from .solve import Kind, Operated, Shown, Stalled, Term

STROKES = ("cavity", "membrane")
KINDS: Mapping[str, tuple[str, ...]] = {
    "strokes": STROKES,
    "displacement": (*STROKES, "oil-set"),
    "dosing": (*STROKES, "centrifugal"),
}
"""Kinds of pumps that have effects in common, by one word."""

ROUNDS = 30
"""Iterations in which a hose and the pressure in it settle."""

HALVINGS = 40
"""Of the range in which the speed of a limited converter is sought."""

CONSTANTS: Mapping[str, Any] = {
    **{"BAR": BAR, "LITRE_PER_HOUR": LITRE_PER_HOUR, "RPM": RPM, "MINUTE": 60.0, "late": late}
}
"""Names in the formulas beside the attributes of `Here` and `State`."""


@dataclass(frozen=True)
class Effect:
    """A kind of effect; see `effects.yaml`.

    Attributes
    ----------
    at : `pump` for a pump module, `mixer` for a mixer
    kinds : of pumps that can have it; empty for all but valves
    low, high : of the size; both 1 of an effect without a size
    corner, timed, slow : how it acts
    """

    name: str
    title: str
    stated: Mapping[str, Any] = field(repr=False, compare=False)
    low: float = 1.0
    high: float = 1.0
    sort: str = "physics"
    at: str = "pump"
    kinds: tuple[str, ...] = ()
    driver: str = ""
    corner: bool = False
    timed: bool = False
    slow: bool = False

    @property
    def whole(self) -> bool:
        """Whether it has no size."""
        return "size" not in self.stated

    @property
    def entries(self) -> Mapping[str, Mapping[str, str]]:
        """Right entries of the catalogue, with formulas of their parameters."""
        found: Mapping[str, Mapping[str, str]] = self.stated.get("entries", {})
        return found


@dataclass(frozen=True)
class Placed:
    """An effect in a module."""

    effect: Effect
    module: str

    @property
    def places(self) -> tuple[str, ...]:
        """The right places."""
        return tuple(f"{self.module}.{place}" for place in self.effect.stated["places"])


@dataclass(frozen=True)
class Made:
    """An effect of some size: its terms, its numbers of this plant, the true parameters of its
    entries, its places in other modules, and its size."""

    changes: tuple[Term, ...]
    fixed: Mapping[str, Any]
    parameters: Mapping[str, Mapping[str, float]]
    elsewhere: tuple[str, ...] = ()
    size: float = math.nan


@dataclass(frozen=True)
class Here(Drawn):
    """Place and size of an effect. All attributes are names in the formulas of `effects.yaml`."""

    scene: Scene
    module: str

    def plain(self, signal: str) -> Array:
        """Return the true values of a signal of the module without effects, SI."""
        return self.scene.plain[f"{self.module}.{signal}"]

    def value(self, parameter: str) -> float:
        """Return a true parameter of the module, SI."""
        return self.scene.values[f"{self.module}.{parameter}"]

    def quantile(self, values: Array, share: float) -> float:
        """Return a quantile of the first recording, which shapes an effect."""
        return float(np.quantile(values[self.scene.shaping], share))

    def median(self, values: Array) -> float:
        """Return the median of the first recording."""
        return float(np.median(values[self.scene.shaping]))

    def usual(self, signal: str) -> float:
        """Return the median of a signal."""
        return self.median(self.plain(signal))

    def limit(self, signal: str, low: float, high: float) -> float:
        """Return a quantile of a signal, at a drawn share."""
        return self.quantile(self.plain(signal), self.between(low, high))

    def span(self, signal: str) -> float:
        """Return the range of a signal in the first recording."""
        return float(np.ptp(self.plain(signal)[self.scene.shaping]))

    def another(self, signal: str) -> str:
        """Draw the place of a signal of another pump; raises Stalled if there is none."""
        others = [m for m in self.scene.rig.pumps if m != self.module]
        if not others:
            raise Stalled("no other pump whose column could be taken")
        return f"{self.random.choice(others)}.{signal}"

    @property
    def feeds(self) -> Array:
        """Flow of each pump that feeds a mixer, or of the pump itself, shape (pumps, n)."""
        rig = self.scene.rig
        pumps = [m for m in rig.pumps if self.module in (m, *rig.path(m))]
        return np.array([self.scene.plain[f"{m}.Q"] for m in pumps])

    def side(self, signal: str) -> Array:
        """Return 1 where a signal was last raised and -1 where it was lowered, with play."""
        values, least = self.plain(signal), 0.02 * self.span(signal)
        state, last, side = np.zeros_like(values), float(values[0]), 1.0
        for k, now in enumerate(values):
            if abs(now - last) > least:
                side, last = float(np.sign(now - last)), float(now)
            state[k] = side
        return state

    def there(self) -> Array:
        """Draw the course of a fault, 1 while present: to the end, or for a while."""
        time, length = self.scene.time, self.scene.length
        begin = self.between(0.25, 0.6) * length
        # A fault that lasts to the end also lasts in a further recording.
        lasts = self.random.uniform() < 0.6
        end = math.inf if lasts else begin + self.between(0.15, 0.3) * length
        return ((time >= begin) & (time <= end)).astype(float)

    @property
    def kind(self) -> PumpKind:
        """The kind of the pump."""
        return self.scene.rig.kind(self.module)

    @cached_property
    def own(self) -> dict[str, Any]:
        """All true parameters of the module by their own names, SI."""
        scene = self.scene
        return Operated(scene.rig, scene.values, scene.given).parameters(self.module)

    def widened(self, static: float, friction: float, behind: Array, flow: Array) -> Array:
        """Return the change of a hose's friction; size is the share of the flow per bar."""
        factor = np.ones_like(flow)
        for _ in range(ROUNDS):
            pressure = behind + static + friction * factor * flow * np.abs(flow)
            factor = (1.0 + self.size * np.maximum(pressure, 0.0) / BAR) ** -2
        return np.asarray(factor - 1.0)

    def folded_back(self, most: float, speed: Array, pressure: Array, flow: Array) -> Array:
        """Return the share of the speed that a converter takes off above a power."""
        low, high = np.zeros_like(speed), np.full_like(speed, 0.9)
        for _ in range(HALVINGS):
            share = 0.5 * (low + high)
            power = self.kind.power(self.own, speed * (1.0 - share), pressure, flow)
            more = self.size * np.maximum(power / most - 1.0, 0.0) > share
            low, high = np.where(more, share, low), np.where(more, high, share)
        return np.asarray(0.5 * (low + high))


def made(effect: Effect, here: Here) -> Made:
    """Make an effect; raises Stalled if the plant cannot have it."""
    stated, names = effect.stated, Names(here, CONSTANTS, NAMES)
    names.fix(stated.get("fixed", {}))
    place = f"{here.module}.{{}}".format
    terms = [
        Term(kind, here.module, _law(kind, names, stated[kind]))
        for kind in get_args(Kind)
        if kind in stated
    ]
    for signal, formula in stated.get("reading", {}).items():
        terms.append(Term("reading", place(signal), _law("reading", names, formula)))
    elsewhere = (names.of(stated["elsewhere"]),) if "elsewhere" in stated else ()
    for signal, formula in stated.get("column", {}).items():
        own = place(signal)
        terms.append(Term("column", own, _law("column", names, formula, own)))
        # The columns of two pumps are exchanged.
        terms += [Term("column", other, _law("column", names, "own", own)) for other in elsewhere]
    parameters = {
        entry: {name: float(names.of(formula)) for name, formula in formulas.items()}
        for entry, formulas in effect.entries.items()
    }
    return Made(tuple(terms), dict(names), parameters, elsewhere, here.size)


def _law(
    kind: Kind | Shown, names: Names, formula: str, source: str = ""
) -> Callable[[Any], Array]:
    """The law of a term by its formula; `source` is the signal that it calls `own`."""

    def law(given: Any) -> Array:
        if kind == "reading":
            more = {"shown": given}
        else:
            more = {"own": given[source], "columns": given} if kind == "column" else vars(given)
        return np.asarray(names.with_(**more).of(formula))

    return law


def _effect(name: str, stated: Mapping[str, Any]) -> Effect:
    words = stated.get("of", [])
    kinds = [KINDS.get(word, (word,)) for word in ([words] if isinstance(words, str) else words)]
    low, high = map(float, stated.get("size", (1.0, 1.0)))
    own = {key: stated[key] for key in ("sort", "at", "driver") if key in stated}
    own |= dict.fromkeys(stated.get("is", ()), True)
    if stated.get("at") == "mixer":
        kinds = []
    return Effect(name, stated["title"], stated, low, high, kinds=(*chain(*kinds),), **own)


_TABLES = yaml.safe_load(Path(__file__).with_name("effects.yaml").read_text(encoding="utf-8"))

NAMES: Mapping[str, str] = _TABLES["names"]
"""What formulas may use of the place of an effect."""

EFFECTS: Mapping[str, Effect] = {n: _effect(n, stated) for n, stated in _TABLES["effects"].items()}

WIRING: Mapping[str, Effect] = {n: _effect(n, stated) for n, stated in _TABLES["wiring"].items()}
"""Mistakes of wiring and files: they have cases of their own and are no rivals of effects."""


def effect_of(name: str) -> Effect:
    """Return an effect or a mistake by its name."""
    return {**EFFECTS, **WIRING}[name]


def places_of(rig: Rig, effect: Effect) -> list[Placed]:
    """Return the possible places of an effect."""
    if effect.at == "mixer":
        return [Placed(effect, m) for m in rig.mixers]
    kinds = effect.kinds or tuple(kind for kind in PUMPS if kind != "valve")
    return [Placed(effect, m) for m, kind in rig.pumps.items() if kind in kinds]
