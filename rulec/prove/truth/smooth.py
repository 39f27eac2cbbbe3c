"""Smooth random courses: form errors of laws, coloured noise, slow drifts."""

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from .streams import stream
from .units import Array

SIZE_OF_FORM = 0.005, 0.02
"""Root mean square of a law's form error in hard cases, smallest and largest."""

COLOUR = 0.5, 0.9
"""Coefficient of first-order noise at the sample rate, smallest and largest."""

WAVES = 6
"""Cosines of a form error."""

FREQUENCIES = 0.25, 1.0
"""Least and most periods of a cosine over the range of an argument."""

GRID = 41
"""Points along a range for normalising a form error."""

STEADY = 0.3
"""Least share of its class over which a drifting sensor moves."""


@dataclass(frozen=True)
class Form:
    """The relative error of a law: a sum of cosines of its arguments, scaled to their ranges.

    Attributes
    ----------
    rms : root mean square over the range; the mean is zero
    ranges : of each argument, SI
    waves : angles per range, shape (WAVES, arguments); phases, weights : shape (WAVES,)
    middle, factor : normalise mean and size
    """

    rms: float
    ranges: tuple[tuple[float, float], ...]
    waves: Array
    phases: Array
    weights: Array
    middle: float = 0.0
    factor: float = 1.0

    def __call__(self, *arguments: Array) -> Array:
        """Return the share, 1; arguments have one shape, SI."""
        total = np.zeros(np.shape(arguments[0]))
        scaled = [
            (a - low) / (high - low) for a, (low, high) in zip(arguments, self.ranges, strict=True)
        ]
        for wave, phase, weight in zip(self.waves, self.phases, self.weights, strict=True):
            angle = sum(w * x for w, x in zip(wave, scaled, strict=True))
            total = total + weight * np.cos(angle + phase)
        return np.asarray(self.factor * (total - self.middle))

    def at(self, value: float) -> float:
        """Return the share by the only argument, constant beyond its range.

        It is in plain numbers, as an integrator asks for one at a time.
        """
        ((low, high),) = self.ranges
        share = min(max((value - low) / (high - low), 0.0), 1.0)
        total = sum(w * math.cos(a * share + p) for a, p, w in self._cosines)
        return self.factor * (total - self.middle)

    @functools.cached_property
    def _cosines(self) -> list[tuple[float, float, float]]:
        """Angle per range, phase and weight of each cosine of the only argument."""
        parts = (self.waves[:, 0].tolist(), self.phases.tolist(), self.weights.tolist())
        return list(zip(*parts, strict=True))


def form_error(
    random: np.random.Generator, rms: float, ranges: tuple[tuple[float, float], ...]
) -> Form:
    """Draw a form error with a root mean square over the range of its arguments."""
    size = (WAVES, len(ranges))
    turns = random.uniform(*FREQUENCIES, size) * random.choice([-1.0, 1.0], size)
    phases = random.uniform(0.0, 2.0 * np.pi, WAVES)
    plain = Form(rms, ranges, 2.0 * np.pi * turns, phases, random.standard_normal(WAVES))
    axes = [np.linspace(low, high, GRID) for low, high in ranges]
    values = plain(*np.meshgrid(*axes))
    middle = float(values.mean())
    return Form(rms, ranges, plain.waves, phases, plain.weights, middle, rms / float(values.std()))


def coloured(white: Array, coefficient: float) -> Array:
    """Return first-order noise with the variance of white noise, shape (n,).

    Source: x[k] = c x[k-1] + sqrt(1 - c^2) w[k], stationary from the first sample.
    """
    found, last = np.empty_like(white), float(white[0])
    fresh = float(np.sqrt(1.0 - coefficient**2))
    for k, now in enumerate(white):
        last = coefficient * last + fresh * float(now) if k else last
        found[k] = last
    return found


@dataclass(frozen=True)
class Drift:
    """Slow course of a sensor's error inside its class.

    Attributes
    ----------
    extent : share of the way to each draw that the error moves
    draws : errors at equidistant knots, standard normal clipped at two, shape (k,)
    """

    extent: float
    draws: Array

    def __call__(self, first: float, samples: int) -> Array:
        """Return the errors of all samples in standard deviations, shape (samples,)."""
        knots = first + self.extent * (np.concatenate([[first], self.draws]) - first)
        along = np.linspace(0.0, len(knots) - 1.0, samples)
        left = np.minimum(along.astype(int), len(knots) - 2)
        share = 0.5 - 0.5 * np.cos(np.pi * (along - left))
        # Between two values inside the class, so always inside.
        return np.asarray(knots[left] * (1.0 - share) + knots[left + 1] * share)


def drift(random: np.random.Generator) -> Drift:
    """Draw a drift with one to three knots after the first."""
    extent = float(random.uniform(STEADY, 1.0))
    return Drift(extent, np.clip(random.standard_normal(int(random.integers(1, 4))), -2.0, 2.0))


def held(
    random: np.random.Generator,
    samples: int,
    shortest: int,
    longest: int,
    draw: Callable[[], float] | None = None,
) -> Array:
    """Draw successive values, by default between 0 and 1, each held for some samples."""
    result, begin = np.empty(samples), 0
    while begin < samples:
        end = begin + int(random.integers(shortest, longest + 1))
        result[begin:end] = draw() if draw else random.uniform()
        begin = end
    return result


def wobble(random: np.random.Generator, samples: int) -> Array:
    """Draw a slow course with a root mean square of about 1 and periods of 40 to 200 samples."""
    time, total = np.arange(samples), np.zeros(samples)
    for _ in range(3):
        period, phase = random.uniform(40.0, 200.0), random.uniform(0.0, 2.0 * np.pi)
        total += np.sqrt(2.0 / 3.0) * np.sin(2.0 * np.pi * time / period + phase)
    return total


def between(random: np.random.Generator, ends: tuple[float, float]) -> float:
    """Draw uniformly on a logarithmic scale."""
    return math.exp(random.uniform(math.log(ends[0]), math.log(ends[1])))


def form_errors(
    seed: int, laws: Iterable[tuple[str, tuple[tuple[float, float], ...]]]
) -> dict[str, Form]:
    """Draw the form error of each law, given with the ranges of its arguments, SI."""
    found = {}
    for law, ranges in laws:
        random = stream(seed, f"form {law}")
        found[law] = form_error(random, between(random, SIZE_OF_FORM), ranges)
    return found


def colours(seed: int, sensors: Iterable[str]) -> dict[str, float]:
    """Draw the coefficient of each sensor's noise."""
    return {s: float(stream(seed, f"colour {s}").uniform(*COLOUR)) for s in sensors}


def drifts(seed: int, sensors: Iterable[str]) -> dict[str, Drift]:
    """Draw the drift of each sensor."""
    return {s: drift(stream(seed, f"drift {s}")) for s in sensors}
