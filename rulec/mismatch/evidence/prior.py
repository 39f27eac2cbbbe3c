"""The prior of the values of a model: parameters, errors of sensors, unknowns of effects."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.special import stdtr, stdtrit

from rulec.effects.candidate import BaseParameters, Unknown
from rulec.knowledge.parameter_belief import Belief, Coordinates, LocalBelief, belief_in, peak_of
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration


@dataclass(frozen=True, kw_only=True)
class Prior:
    """Prior of the free values; arrays have shape (values,).

    Values are fitted in `coordinates`, the logarithms of positive parameters. The first ones are
    parameters of the plant with the prior `belief`. The others have a `mean` and a `precision`
    (1/u^2; 0: no prior), and are Student distributed where `freedom` is finite. `lowest` and
    `highest` bound them; `size` is a typical step. `odds` normalise the prior within the bounds.
    """

    names: tuple[str, ...]
    coordinates: Coordinates
    belief: Belief
    mean: Array
    precision: Array
    freedom: Array
    lowest: Array
    highest: Array
    size: Array
    odds: float = 0.0

    def of(self, values: Mapping[str, float]) -> Array:
        """Coordinates of values, SI, by name; those without a value are at their mean."""
        means = self.coordinates.values(self.mean)
        own = np.array([values.get(n, m) for n, m in zip(self.names, means, strict=True)])
        return self.coordinates.of(own)

    def values(self, at: Array) -> dict[str, float]:
        """Values, SI, at coordinates."""
        return dict(zip(self.names, self.coordinates.values(at).tolist(), strict=True))

    def near(self, at: Array) -> LocalBelief:
        """The prior near some coordinates."""
        k = len(self.belief.names)
        plant = self.belief.near(at[:k])
        mean, precision = self.mean.copy(), np.diag(self.precision + 1e-12 / self.size**2)
        mean[:k] = plant.mean
        precision[:k, :k] += plant.precision
        stated = np.flatnonzero(self.precision)
        precisions, freedom = self.precision[stated], self.freedom[stated]
        square = precisions * (at - mean)[stated] ** 2
        wide = np.isfinite(freedom)
        tails = np.where(wide, peak_of(np.where(wide, freedom, 1.0)), 0.0) - 0.5 * square
        free = freedom[wide]
        tails[wide] += 0.5 * square[wide] - 0.5 * (free + 1.0) * np.log1p(square[wide] / free)
        at_wide = stated[wide]
        precision[at_wide, at_wide] *= (free + 1.0) / (free + square[wide])
        density = plant.density + self.odds + float(np.sum(tails + 0.5 * np.log(precisions)))
        return LocalBelief(density, mean, precision)


def belief_of(base: BaseParameters, at: Sequence[int]) -> Belief:
    """The prior of some parameters of a plant, by number."""
    rows, names = list(at), [base.ids[i] for i in at]
    covariance = base.covariance[np.ix_(rows, rows)]
    return belief_in(names, base.positive[rows], base.values[rows], covariance, base.sheet)


def prior_with(
    belief: Belief,
    errors: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    setting: Configuration,
) -> Prior:
    """The prior of parameters of the plant, of errors of sensors by their precision, and of
    unknowns by their range."""
    k = len(belief.names)
    first = k + len(errors)
    size = first + len(bounds)
    mean, precision, scale = np.zeros(size), np.zeros(size), np.ones(size)
    freedom = np.full(size, np.inf)
    lowest, highest = np.full(size, -np.inf), np.full(size, np.inf)
    if k:
        mean[:k] = belief.mean
        scale[:k] = 1.0 / np.sqrt(np.diag(belief.near(belief.mean).precision))
        far = np.where(belief.coordinates.positive, limits.FARTHEST, np.inf)
        lowest[:k], highest[:k] = mean[:k] - far, mean[:k] + far
    precision[k:first] = list(errors.values())
    for i, (name, ends) in enumerate(bounds.items(), start=first):
        lowest[i], highest[i] = ends
        width = highest[i] - lowest[i]
        scale[i] = max(abs(setting.values[name]), 1e-3 * width if np.isfinite(width) else 1e-12)
        if name in setting.priors:
            mean[i], width, freedom[i] = setting.priors[name]
            precision[i] = width**-2
    rest = np.zeros(size - k, dtype=bool)
    return Prior(
        names=(*belief.names, *errors, *bounds),
        coordinates=Coordinates(np.concatenate([belief.coordinates.positive, rest])),
        belief=belief,
        mean=mean,
        precision=precision,
        freedom=freedom,
        lowest=lowest,
        highest=highest,
        size=scale,
    )


@dataclass(frozen=True)
class Size:
    """Prior of the distance of an amplitude from its null.

    A Student distribution about the `usual` size with a `width`, infinite where none is stated, and
    `freedom`. `scale` is that of a Student distribution about the null whose median distance is
    the usual one; its tail falls as that of the log-normal distribution at two standard deviations.
    """

    scale: float
    freedom: float
    usual: float = 0.0
    width: float = float("inf")


def log_inside(size: Size, unknown: Unknown) -> float:
    """Logarithm of the prior share of amplitudes within the range of an unknown; both signs are
    equally likely."""
    null = unknown.null or 0.0
    ends = np.array([unknown.lowest - null, unknown.highest - null])
    signs = (np.array([1.0]), np.array([-1.0]))
    shares = [np.diff(stdtr(size.freedom, (ends - s * size.usual) / size.width))[0] for s in signs]
    return float(np.log(max(sum(shares), 1e-12)))


def size_of(unknown: Unknown, share: Callable[[], float]) -> Size:
    """The prior of an amplitude by the usual size in its entry.

    `share` gives the relative change of its place per amplitude.
    """
    usual = unknown.usual
    if usual is None:
        width = unknown.highest - unknown.lowest
        return Size(width / 4.0 if np.isfinite(width) else 1.0, 1.0)
    spread = float(np.log(usual.factor))
    freedom = 2.0 / spread
    median = usual.size / share() if usual.of_place else usual.size
    return Size(median / float(stdtrit(freedom, 0.75)), freedom, median, median * spread)


def priors_of(prior: Prior, setting: Configuration) -> dict[str, tuple[float, float, float]]:
    """Mean, scale and degrees of freedom of those unknowns that have a prior."""
    unknowns = set(setting.free_unknowns())
    each = zip(prior.names, prior.mean, prior.precision, prior.freedom, strict=True)
    return {n: (float(m), float(k**-0.5), float(f)) for n, m, k, f in each if n in unknowns and k}


def range_over(unknown: Unknown, start: float, driver: Array | None) -> tuple[float, float]:
    """Middle and width of the range of a shape, by the readings of its driver."""
    if driver is not None:
        low, high = np.nanquantile(driver, [0.02, 0.98])
        return float(low + high) / 2, max(float(high - low), 1e-12)
    if unknown.offset:
        # The zero of its unit is arbitrary: only the stated range is known.
        return (unknown.lowest + unknown.highest) / 2, unknown.highest - unknown.lowest
    width = 2.0 * max((abs(s) for s in unknown.starts), default=abs(start)) or 1.0
    return float(np.sign(start) or 1.0) * width / 2, width


def strengths(unknown: Unknown, sign: float = 0.0) -> list[float]:
    """Starting amplitudes of an entry, SI, the smallest first, of the given sign if that is not
    0."""
    null = unknown.null or 0.0
    starts = [s for s in unknown.starts if s != null and (not sign or np.sign(s - null) == sign)]
    starts = starts or [null + (sign or 1.0) * step_of(unknown)]
    starts.sort(key=lambda s: abs(s - null))
    return [float(np.clip(s, unknown.lowest, unknown.highest)) for s in starts]


def usual(unknown: Unknown) -> float:
    """The smallest starting amplitude of an entry, SI."""
    return strengths(unknown)[0]


def step_of(unknown: Unknown) -> float:
    """A typical step of an unknown: to its nearest start, or else a tenth of its range, SI."""
    null, span = unknown.null or 0.0, unknown.highest - unknown.lowest
    steps = (abs(s - null) for s in unknown.starts if s != null)
    return min(steps, default=0.1 * span if np.isfinite(span) else unknown.factor)
