"""Effects of a stationary plant, from `effects.yaml`, and what one of some size changes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, get_args

import numpy as np
import yaml

from ..formulas import Names
from ..units import BAR, LITRE_PER_HOUR, RPM, Array
from .drive import late
from .operated_plant import Scene
from .rig import PUMPS, Rig
from .solve import Change, Column, Kind, Operated, Reading, Stalled, Term

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

MOST = 0.9
"""Largest share of the head that is lost; then the pump only churns."""


AMBIENT, VAPOUR = 1.013 * BAR, 0.0234 * BAR
"""Pressure of the air, and vapour pressure of water at 20 degC. Source: IAPWS, saturation line."""

CONSTANTS: Mapping[str, Any] = {
    **{"BAR": BAR, "LITRE_PER_HOUR": LITRE_PER_HOUR, "RPM": RPM, "MINUTE": 60.0, "late": late},
    **{"AMBIENT": AMBIENT, "VAPOUR": VAPOUR},
    # Pressure in a choked jet over vapour pressure. Source: IEC 60534-2-1, FF.
    "CRITICAL": 0.96 - 0.28 * (VAPOUR / 220.64e5) ** 0.5,
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

    changes: tuple[Change, ...]
    fixed: Mapping[str, Any]
    parameters: Mapping[str, Mapping[str, float]]
    elsewhere: tuple[str, ...] = ()
    size: float = math.nan


@dataclass(frozen=True)
class Here:
    """Place and size of an effect; `random` draws its shape.

    All attributes are names in the formulas of `effects.yaml`, beside `known`.
    """

    scene: Scene
    module: str
    size: float
    random: np.random.Generator

    def plain(self, signal: str) -> Array:
        """Return the true values of a signal of the module without effects, SI."""
        return self.scene.plain[f"{self.module}.{signal}"]

    def value(self, parameter: str) -> float:
        """Return a true parameter of the module, SI."""
        return self.scene.values[f"{self.module}.{parameter}"]

    def median(self, values: Array) -> float:
        """Return the median of the first recording, which shapes an effect."""
        return float(np.median(values[self.scene.known]))

    def usual(self, signal: str) -> float:
        """Return the median of a signal."""
        return self.median(self.plain(signal))

    def quantile(self, values: Array, share: float) -> float:
        """Return a quantile of the first recording."""
        return float(np.quantile(values[self.scene.known], share))

    def limit(self, signal: str, low: float, high: float) -> float:
        """Return a quantile of a signal, at a drawn share."""
        return self.quantile(self.plain(signal), self.between(low, high))

    def span(self, signal: str) -> float:
        """Return the range of a signal in the first recording."""
        return float(np.ptp(self.plain(signal)[self.scene.known]))

    def between(self, low: float, high: float) -> float:
        """Draw uniformly."""
        return float(self.random.uniform(low, high))

    def choice(self, *values: float) -> float:
        """Draw one of some numbers."""
        return float(self.random.choice(values))

    def signed(self, down: float = -1.0) -> float:
        """Draw the size, or `down` times it."""
        return self.size * float(self.random.choice([down, 1.0]))

    def another(self, signal: str) -> str:
        """Draw the place of a signal of another pump; raises Stalled if there is none."""
        others = [m for m in self.scene.rig.pumps if m != self.module]
        if not others:
            raise Stalled("no other pump whose column could be taken")
        return f"{self.random.choice(others)}.{signal}"

    @property
    def warmer(self) -> Array:
        """Temperature of the liquid above its median, K; for a mixer, at the first pump."""
        values = self.scene.plain.get(f"{self.module}.T", self.scene.warmth)
        return np.asarray(values - self.median(values))

    @property
    def _feeds(self) -> list[Array]:
        """Flow of each pump that feeds a mixer."""
        rig = self.scene.rig
        return [self.scene.plain[f"{n}.Q"] for n in rig.pumps if self.module in rig.path(n)]

    @property
    def usual_flow(self) -> float:
        """Median flow through a pump or mixer."""
        if self.module in self.scene.rig.pumps:
            return self.usual("Q")
        return self.median(np.asarray(np.sum(self._feeds, axis=0)))

    @property
    def first_feed(self) -> Array:
        """Share of the first feed in the flow of a mixer."""
        flows = np.array(self._feeds)
        return np.asarray(flows[0] / flows.sum(axis=0))

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

    @cached_property
    def own(self) -> dict[str, Any]:
        """All true parameters of the module by their own names, SI."""
        scene = self.scene
        return Operated(scene.rig, scene.values, scene.given).parameters(self.module)

    def lost(self, share: Array, pressure: Array) -> Array:
        """Return the pressure lost with a share of the head; `pressure` is the rest."""
        kept = 1.0 - np.minimum(share, MOST)
        return np.asarray(pressure * (1.0 / kept - 1.0))

    def head_of(self, speed: Array, flow: Array) -> Array:
        """Return the head of the pump's plain law."""
        return self.scene.rig.kind(self.module).head(self.own, speed, flow)

    def widened(self, static: float, friction: float, behind: Array, flow: Array) -> Array:
        """Return the change of a hose's friction; size is the share of the flow per bar."""
        factor = np.ones_like(flow)
        for _ in range(ROUNDS):
            pressure = behind + static + friction * factor * flow * np.abs(flow)
            factor = (1.0 + self.size * np.maximum(pressure, 0.0) / BAR) ** -2
        return np.asarray(factor - 1.0)

    def folded_back(self, most: float, speed: Array, pressure: Array, flow: Array) -> Array:
        """Return the share of the speed that a converter takes off above a power."""
        kind = self.scene.rig.kind(self.module)
        low, high = np.zeros_like(speed), np.full_like(speed, 0.9)
        for _ in range(HALVINGS):
            share = 0.5 * (low + high)
            power = kind.power(self.own, speed * (1.0 - share), pressure, flow)
            more = self.size * np.maximum(power / most - 1.0, 0.0) > share
            low, high = np.where(more, share, low), np.where(more, high, share)
        return np.asarray(0.5 * (low + high))


def known(here: Here) -> Mapping[str, Any]:
    """Return constants and courses that formulas may use, beside the attributes of `here`.

    `time` is in samples since the recording began, `length` likewise, `pace` in s; `grown` is the
    linear growth to the size at the end, and `per_day` its rate.
    """
    scene, module, size = here.scene, here.module, here.size
    return {
        **CONSTANTS,
        **{"time": scene.time, "length": scene.length, "pace": scene.pace, "days": scene.days},
        **{"grown": size * scene.time / scene.length, "per_day": size / scene.days},
        "suction": scene.plain.get(f"{module}.{'p_1' if scene.rig.by_travel else 'p_s'}"),
        "density": scene.plain.get(f"{module}.rho"),
        "samples_late": max(round(size), 1),
    }


def made(effect: Effect, here: Here) -> Made:
    """Make an effect; raises Stalled if the plant cannot have it."""
    stated, names = effect.stated, Names(here, known(here))
    names.fix(stated.get("fixed", {}))
    changes: list[Change] = [
        _term(kind, here.module, names, stated[kind]) for kind in get_args(Kind) if kind in stated
    ]
    for signal, formula in stated.get("reading", {}).items():
        changes.append(_reading(f"{here.module}.{signal}", names, formula))
    elsewhere = (names.of(stated["elsewhere"]),) if "elsewhere" in stated else ()
    for signal, formula in stated.get("column", {}).items():
        place = f"{here.module}.{signal}"
        changes.append(_column(place, place, names, formula))
        # The columns of two pumps are exchanged.
        changes += [_column(other, place, names, "own") for other in elsewhere]
    parameters = {
        entry: {name: float(names.of(formula)) for name, formula in formulas.items()}
        for entry, formulas in effect.entries.items()
    }
    return Made(tuple(changes), dict(names), parameters, elsewhere, here.size)


def _term(kind: Kind, module: str, names: Names, formula: str) -> Term:
    return Term(kind, module, lambda state: np.asarray(names.with_(**vars(state)).of(formula)))


def _reading(place: str, names: Names, formula: str) -> Reading:
    return Reading(place, lambda value: np.asarray(names.with_(shown=value).of(formula)))


def _column(place: str, source: str, names: Names, formula: str) -> Column:
    return Column(place, lambda c: np.asarray(names.with_(own=c[source], columns=c).of(formula)))


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
