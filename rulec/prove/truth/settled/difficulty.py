"""Difficulties beyond the plain laws of a case: form errors, coloured noise, drifts.

They belong to the plant or its sensors, and none of them is an effect to be found.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..smooth import Drift, Form, between, colours, drifts, form_errors
from ..streams import stream
from ..units import Array
from .rig import Rig, Values
from .solve import Operated, State, Term, solve

WOBBLE = 0.002, 0.01
"""Wobble of a setting over its range, root mean square, smallest and largest."""

Ranges = tuple[tuple[float, float], ...]
"""Range of each argument of a law, SI."""


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

    form: Mapping[str, Form]
    colour: Mapping[str, float]
    drift: Mapping[str, Drift]
    wobble: Mapping[str, float]

    @property
    def sizes(self) -> dict[str, dict[str, float]]:
        """Their sizes in the sealed answer."""
        found = {
            "form": {law: form.rms for law, form in self.form.items()},
            "coloured": dict(self.colour),
            "drift": {place: drift.extent for place, drift in self.drift.items()},
            "wobble": dict(self.wobble),
        }
        return {name: sizes for name, sizes in found.items() if sizes}

    def terms(self, rig: Rig, values: Values) -> tuple[Term, ...]:
        """Return the form errors as terms of the plant."""
        return tuple(_term(rig, values, law, form) for law, form in self.form.items())


def difficulty(rig: Rig, names: Sequence[str], seed: int) -> Difficulty:
    """Draw the named difficulties; raises Stalled if the plant cannot run at its fastest."""
    wobbling = rig.inputs if "wobble" in names else ()
    return Difficulty(
        form_errors(seed, _laws(rig)) if "form" in names else {},
        colours(seed, rig.sensors) if "coloured" in names else {},
        drifts(seed, rig.sensors) if "drift" in names else {},
        {n: between(stream(seed, f"size of wobble {n}"), WOBBLE) for n in wobbling},
    )


def _laws(rig: Rig) -> Iterator[tuple[str, Ranges]]:
    """Every law of a plant with the ranges of its arguments."""
    if rig.by_load:
        laws = ("flow",) if rig.by_travel else ("flow", "power")
        for m in rig.pumps:
            kind = rig.kind(m)
            load = kind.settings["dp"]
            own = (kind.speeds, load) if rig.by_travel else (load,)
            yield from ((f"{m}.{law}", own) for law in laws)
        return
    values = {name: value for name, (value, _) in rig.numbers.items()}
    fastest = {f"{m}.n": np.array([rig.kind(m).speeds[1]]) for m in rig.pumps}
    if rig.by_meter:
        # The pressure is largest against a closed valve.
        fastest |= {f"{m}.Q": np.zeros(1) for m in rig.pumps}
    most = {name: float(v[0]) for name, v in solve(Operated(rig, values, fastest)).items()}
    for m in rig.pumps:
        point = rig.kind(m).speeds, (0.0, most[f"{m}.dp"])
        yield f"{m}.head" if rig.kind(m).by_head else f"{m}.flow", point
        yield f"{m}.power", point
        if not rig.by_meter:
            yield f"{m}.loss", ((0.0, most[f"{m}.Q"]),)
    for mixer in rig.mixers:
        total = sum(most[f"{m}.Q"] for m in rig.pumps if mixer in rig.path(m))
        yield f"{mixer}.loss", ((0.0, total),)


def _term(rig: Rig, values: Values, law: str, form: Callable[..., Array]) -> Term:
    """A form error as a term; `form` gives the share by the law's arguments."""
    module, _, kind = law.partition(".")

    def share(s: State) -> Array:
        by_pressure = rig.by_load and not rig.by_travel
        return form(s.pressure) if by_pressure else form(s.speed, s.pressure)

    match kind:
        case "flow":
            return Term("gain", module, lambda s: -share(s))
        case "head":
            return Term("head", module, lambda s: -s.pressure * share(s))
        case "power":
            return Term("power", module, lambda s: s.power * share(s))
    k0, k2 = values[f"{module}.k0"], values[f"{module}.k2"]
    return Term("loss", module, lambda s: (k0 + k2 * s.flow * np.abs(s.flow)) * form(s.flow))
