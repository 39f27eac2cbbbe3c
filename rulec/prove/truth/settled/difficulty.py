"""Difficulties beyond the plain laws of a case: form errors, coloured noise, drifts.

They belong to the plant or its sensors, and none of them is an effect to be found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..smooth import Drift, Form, drift, form_error
from ..streams import stream
from ..units import Array
from .pumps import Values
from .rig import Rig
from .solve import Operated, solve
from .term import Change, State, Term

FORM = 0.005, 0.02
"""Root mean square of a law's form error, smallest and largest."""

COLOUR = 0.5, 0.9
"""Coefficient of first-order noise at the sample rate, smallest and largest."""

WOBBLE = 0.002, 0.01
"""Wobble of a setting over its range, root mean square, smallest and largest."""


@dataclass(frozen=True)
class Difficulty:
    """The difficulties of one case.

    Attributes
    ----------
    form : form error by law, such as `A.flow`
    colour : coefficient by sensor place
    drift : by sensor place
    wobble : root mean square over the range, by input
    """

    form: Mapping[str, Form] = field(default_factory=dict)
    colour: Mapping[str, float] = field(default_factory=dict)
    drift: Mapping[str, Drift] = field(default_factory=dict)
    wobble: Mapping[str, float] = field(default_factory=dict)

    @property
    def told(self) -> dict[str, dict[str, float]]:
        """Their sizes in the sealed answer."""
        found = {
            "form": {law: form.rms for law, form in self.form.items()},
            "coloured": dict(self.colour),
            "drift": {place: drift.extent for place, drift in self.drift.items()},
            "wobble": dict(self.wobble),
        }
        return {name: sizes for name, sizes in found.items() if sizes}

    def terms(self, rig: Rig, values: Values) -> tuple[Change, ...]:
        """Return the form errors as terms of the plant."""
        return tuple(term(rig, values, law, form) for law, form in self.form.items())


NONE = Difficulty()


def difficulty(rig: Rig, names: Sequence[str], seed: int, load: tuple[float, float]) -> Difficulty:
    """Draw the named difficulties; `load` is the range of the pressure that a load sets, Pa.

    Raises Stalled if the plant cannot run at its fastest.
    """
    form: dict[str, Form] = {}
    if "form" in names:
        for law, ranges in _laws(rig, load):
            random = stream(seed, f"form {law}")
            form[law] = form_error(random, _between(random, FORM), ranges)
    colour = {
        place: float(stream(seed, f"colour {place}").uniform(*COLOUR))
        for place in rig.sensors
        if "coloured" in names
    }
    drifts = {
        place: drift(stream(seed, f"drift {place}")) for place in rig.sensors if "drift" in names
    }
    wobbles = {
        place: _between(stream(seed, f"size of wobble {place}"), WOBBLE)
        for place in rig.inputs
        if "wobble" in names
    }
    return Difficulty(form, colour, drifts, wobbles)


def _between(random: np.random.Generator, ends: tuple[float, float]) -> float:
    """Draw uniformly on a logarithmic scale."""
    return math.exp(random.uniform(math.log(ends[0]), math.log(ends[1])))


def _laws(
    rig: Rig, load: tuple[float, float]
) -> Iterator[tuple[str, tuple[tuple[float, float], ...]]]:
    """Every law of a plant with the ranges of its arguments, SI."""
    if rig.by_load:
        for m in rig.pumps:
            if rig.by_travel:
                yield f"{m}.flow", (rig.kind(m).speeds, load)
            else:
                yield f"{m}.flow", (load,)
                yield f"{m}.power", (load,)
        return
    values = {name: value for name, (value, _) in rig.numbers.items()}
    fastest = {f"{m}.n": np.array([rig.kind(m).speeds[1]]) for m in rig.pumps}
    if rig.by_meter:
        # The pressure is largest against a closed valve.
        fastest |= {f"{m}.Q": np.zeros(1) for m in rig.pumps}
    most = {name: float(v[0]) for name, v in solve(Operated(rig, values, fastest)).items()}
    for m in rig.pumps:
        speeds, flow = rig.kind(m).speeds, (0.0, most[f"{m}.Q"])
        pressure = 0.0, most[f"{m}.dp"]
        yield f"{m}.flow" if rig.kind(m).head is None else f"{m}.head", (speeds, pressure)
        yield f"{m}.power", (speeds, pressure)
        if not rig.by_meter:
            yield f"{m}.loss", (flow,)
    for mixer in rig.mixers:
        total = sum(most[f"{m}.Q"] for m in rig.pumps if mixer in rig.path(m))
        yield f"{mixer}.loss", ((0.0, total),)


def term(rig: Rig, values: Values, law: str, form: Callable[..., Array]) -> Term:
    """Return a form error as a term; `form` gives the share by the law's arguments."""
    module, _, kind = law.partition(".")
    by_pump: Callable[[State], Array] = (
        (lambda s: form(s.pressure))
        if rig.by_load and not rig.by_travel
        else (lambda s: form(s.speed, s.pressure))
    )
    match kind:
        case "flow":
            return Term("gain", module, lambda s: -by_pump(s))
        case "head":
            return Term("head", module, lambda s: -s.pressure * by_pump(s))
        case "power":
            return Term("power", module, lambda s: s.power * by_pump(s))
    k0, k2 = values[f"{module}.k0"], values[f"{module}.k2"]
    return Term("loss", module, lambda s: (k0 + k2 * s.flow * np.abs(s.flow)) * form(s.flow))
