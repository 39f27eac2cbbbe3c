"""A module type's laws fitted to the points of a sheet, and how well they hold."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.optimize import least_squares

from rulec.calibration.sheet_priors import SheetPriors
from rulec.curves.limits import FAR_SHARE, SCALE_ROUNDS, SCALES, SHEET_SCATTER, SMALL_POINT
from rulec.curves.match import Law, Points, explained, laws_of, plan_of, wanted_by
from rulec.curves.sheet import CurveRefused, Grade
from rulec.knowledge.module_type import Accuracy, ModuleType, Parameter
from rulec.limits import ASSUMED_ACCURACY, UNTOLD


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A law compared with the points of a reading.

    Deviations are shares of the points: `scatter` is their root mean square, `usual` their 95 %
    quantile, `largest` the greatest, at the reading `at` (SI). `stated` is the accuracy by the
    type, `tolerance` what the grade allows, `u` the standard uncertainty of the whole curve, a
    share. `varied`: at least two of the readings in the law (or its only one) differ between
    points.
    """

    law: Law
    reading: str
    points: int
    scatter: float
    usual: float
    largest: float
    at: float
    stated: Accuracy
    tolerance: Accuracy
    u: float
    varied: bool

    @property
    def holds(self) -> bool:
        """Does the law keep within the tolerance?"""
        return self.largest <= self.tolerance.share


@dataclass(frozen=True, kw_only=True)
class FittedCurve:
    """Parameters in SI, those that the sheet does not determine (`untold`), and compared laws."""

    kind: ModuleType
    points: Points
    parameters: Mapping[str, float]
    untold: tuple[str, ...]
    laws: tuple[Compared, ...]

    @property
    def holds(self) -> bool:
        """Do all laws keep within the tolerance?"""
        return all(law.holds for law in self.laws)


def fit_curve(
    kind: ModuleType, points: Points, given: Mapping[str, float], grade: Grade | None
) -> FittedCurve:
    """Fit jointly all laws of a type that the points determine.

    Parameters
    ----------
    given : parameters with stated values, SI.

    Raises `CurveRefused` if no law can be fitted or the points are too few.
    """
    laws, readings = laws_of(kind), points.readings
    pairs = explained(laws, readings, wanted_by(kind))
    if not pairs:
        raise CurveRefused(f"no law of {kind.name} can be fitted: {_lacks(kind, laws, readings)}")
    fixed = {n: given.get(n, p.value) for n, p in kind.parameters.items()}
    free = list(dict.fromkeys(n for law, _ in pairs for n in law.free if n not in given))
    rows = [_rows(law, name, readings, set(given)) for law, name in pairs]
    plan = plan_of(kind, [law for law, _ in pairs])
    priors = SheetPriors.of([kind.parameters[name] for name in free])

    def off(values: Array) -> list[Array]:
        """Deviations of each law, shares of the points, shape (rows,) each."""
        named = dict(zip(free, values.tolist(), strict=True))
        out = plan.run({**fixed, **named, **readings})
        return [
            _share(out[law.name], readings[name], chosen)
            for (law, name), chosen in zip(pairs, rows, strict=True)
        ]

    at, covariance = priors.begin, np.zeros((len(free), len(free)))
    if free:
        alone = _by_points_alone(off, [kind.parameters[name] for name in free])
        at = priors.nearest(alone)
        scatter = [max(_root_mean_square(part), SHEET_SCATTER) for part in off(alone)]
        weights = 1.0 / np.repeat(scatter, [len(chosen) for chosen in rows])

        def errors(p: Array) -> Array:
            return np.concatenate([weights * np.concatenate(off(priors.values(p))), priors.far(p)])

        found = least_squares(errors, at, bounds=(priors.lowest, priors.highest), x_scale="jac")
        at, covariance = found.x, np.linalg.pinv(found.jac.T @ found.jac, hermitian=True)
    return FittedCurve(
        kind=kind,
        points=points,
        parameters={**given, **dict(zip(free, priors.values(at).tolist(), strict=True))},
        untold=tuple(n for n, u in zip(free, priors.left(covariance), strict=True) if u > UNTOLD),
        laws=tuple(
            _compared(kind, law, name, part, readings, chosen, grade)
            for (law, name), part, chosen in zip(pairs, off(priors.values(at)), rows, strict=True)
        ),
    )


def _by_points_alone(off: Callable[[Array], list[Array]], stated: Sequence[Parameter]) -> Array:
    """Values fitted to the points alone, SI: from those of the type, and from these scaled.

    Devices of a type may differ in size a thousandfold: there each value is first scaled by the
    power of ten that suits the points best. That may lead to another optimum, so the better fit
    counts.
    """
    values = of_type = np.array([p.value or p.u or p.unit.factor for p in stated])
    low, high = np.array([(p.lowest, p.highest) for p in stated]).T

    def far(p: Array) -> float:
        return float(np.sum(np.log1p(np.concatenate(off(p)) ** 2)))

    for _, i in product(range(SCALE_ROUNDS), range(len(stated))):
        tried = [values * np.where(np.arange(len(values)) == i, f, 1.0) for f in SCALES]
        inside = [p for p in tried if low[i] <= p[i] <= high[i]]
        values = min([values, *inside], key=far)
    ways = []
    for start in (values, of_type):
        size = np.abs(start)
        ends = (low / size, high / size)
        begin = np.clip(start / size, np.nextafter(ends[0], np.inf), np.nextafter(ends[1], -np.inf))
        found = least_squares(
            lambda p, size=size: np.concatenate(off(p * size)), begin, bounds=ends, x_scale="jac"
        )
        ways.append((float(found.cost), found.x * size))
    return np.asarray(min(ways, key=lambda way: way[0])[1])


def _rows(law: Law, name: str, readings: Mapping[str, Array], given: Collection[str]) -> np.ndarray:
    """Rows of the points of a law; refuses fewer points than parameters."""
    rows = np.flatnonzero(np.all([np.isfinite(readings[n]) for n in (name, *law.reads)], axis=0))
    free = [n for n in law.free if n not in given]
    if len(rows) <= len(free):
        raise CurveRefused(
            f"{law.name} has {len(free)} parameters ({', '.join(free)}), and only {len(rows)} "
            f"points of the sheet hold {name} with {', '.join(sorted(law.reads))}; "
            f"{len(free) + 1} are needed"
        )
    if not np.any(readings[name][rows]):
        raise CurveRefused(f"{name} is zero at all points of the sheet")
    return rows


def _share(predicted: Array, measured: Array, rows: np.ndarray) -> Array:
    """Deviations of a law from its points, as shares of the points."""
    measured = measured[rows]
    least = SMALL_POINT * float(np.max(np.abs(measured)))
    off = (predicted if len(predicted) == 1 else predicted[rows]) - measured
    share = off / np.maximum(np.abs(measured), least)
    return np.where(np.isfinite(share), share, FAR_SHARE)


def _root_mean_square(share: Array) -> float:
    return float(np.sqrt(np.mean(share**2)))


def _compared(
    kind: ModuleType,
    law: Law,
    name: str,
    share: Array,
    readings: Mapping[str, Array],
    rows: np.ndarray,
    grade: Grade | None,
) -> Compared:
    stated = kind.laws().get((law.group, law.name)) or Accuracy(ASSUMED_ACCURACY, "[assumed]")
    graded = None if grade is None else grade.of(law.dimension)
    scatter, largest = _root_mean_square(share), int(np.argmax(np.abs(share)))
    size = stated.share / 2.0 if graded is None else graded.share / np.sqrt(6.0)
    inputs = [readings[n][rows] for n in law.reads]
    return Compared(
        law=law,
        reading=name,
        points=len(rows),
        scatter=scatter,
        usual=float(np.quantile(np.abs(share), 0.95)),
        largest=float(np.abs(share[largest])),
        at=float(readings[name][rows][largest]),
        stated=stated,
        tolerance=graded or stated,
        u=float(np.hypot(size, scatter)),
        varied=sum(np.ptp(p) > SMALL_POINT * np.max(np.abs(p)) for p in inputs)
        >= min(2, len(inputs)),
    )


def _lacks(kind: ModuleType, laws: Sequence[Law], readings: Mapping[str, Array]) -> str:
    """What the sheet lacks for each law."""
    if not laws:
        return "each of its laws reads other modules or a fluid, or has no parameter to fit"
    reasons = []
    for law in laws:
        units = [f"{n} [{kind.signals[n].unit.text}]" for n in sorted(law.reads - readings.keys())]
        what = f"lacks {', '.join(units)}" if units else "lacks a column of what it gives"
        reasons.append(f"{law.name} {what}")
    gives = ", ".join(readings) or "nothing of these"
    hint = "name a reading that is the same at all points with --at, as in --at 'n=2900 rpm'"
    return f"{'; '.join(reasons)}. The sheet gives {gives}; {hint}"
