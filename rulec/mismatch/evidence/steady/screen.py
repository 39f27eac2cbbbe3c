"""Which places and which candidates explain the residuals of a fitted model, to first order.

A full refit of every candidate would be slow and needless: most explain nothing. The term of a
candidate is linear in its amplitudes near their null, so its gain follows from projections. Shapes
(thresholds, exponents) are tried on a grid.

Source: score test (Rao 1948); the gain is that of a likelihood with free scale.
"""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import white_noise

from rulec.effects.candidate import MEDIAN, TIME, Candidate, DisturbanceLocation, Unknown
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import CHANGE, Configuration, Course
from rulec.mismatch.evidence.steady.fit import Fitted, student_weights
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.system import System


@dataclass(frozen=True)
class Suspect:
    """A place with the error there that explains each point best, shape (n,), SI of its unit, and
    the weight of each (1/variance)."""

    location: DisturbanceLocation
    course: Array
    weight: Array


def noise_scale(rows: Rows, residual: Array) -> float:
    """Scatter of neighbouring residuals, shape (rows,), over the expected noise; at least 1."""
    if rows.system.data.of_rows:
        return 1.0
    sizes = []
    for cell in rows.cells:
        table = cell.table(residual).T
        if len(table) > 8:
            sizes.append((len(table), white_noise(np.diff(table, 2, axis=0), 2)))
    if not sizes:
        return 1.0
    counts, spreads = np.array(sizes).T
    return max(1.0, float(np.sqrt(np.average(spreads**2, weights=counts))))


def suspect_at(fitted: Fitted, location: DisturbanceLocation, column: Array) -> Suspect:
    """A place with the error that explains each point best, by its slopes, shape (rows,)."""
    rows = fitted.rows
    n = len(rows.system.data)
    weight = np.bincount(rows.point, column**2, minlength=n).astype(float)
    moment = np.bincount(rows.point, column * fitted.residual, minlength=n).astype(float)
    with np.errstate(invalid="ignore", divide="ignore"):
        course = np.where(weight > 0, -moment / weight, np.nan)
    return Suspect(location, course, weight)


def column_at(fitted: Fitted, location: DisturbanceLocation) -> Array | None:
    """Slopes of the residuals by an error at a place, shape (rows,); None where all are 0."""
    system = fitted.rows.system
    if not any(o in system.number for o in location.observers):
        return None
    modules, at = system.reached(location.observers), fitted.predicted
    flows = system.flows(fitted.setting, (location.unknown,), (location.id,), modules, at)
    column = fitted.rows.column(fitted.maps, flows.by_value[location.unknown])
    return column if np.any(column) else None


Changing = tuple[DisturbanceLocation, Array]
"""A place, or a parameter of the law there, and the slopes of all rows by it, shape (rows,)."""


def ways_at(fitted: Fitted, location: DisturbanceLocation) -> list[Changing]:
    """A place, and the parameters of the law there; none where the place does not show.

    A driver seldom adds to a law: it changes a parameter, and shows where that parameter matters.
    """
    column = column_at(fitted, location)
    found = [] if column is None else [(location, column)]
    if column is None or location.kind != "definition":
        return found
    rows, system = fitted.rows, fitted.rows.system
    parameters = system.builder.parameters
    own = [i for i, n in enumerate(parameters.ids) if n.partition(".")[0] == location.module]
    names = [parameters.ids[i] for i in own]
    modules = system.reached(location.observers)
    slopes = system.flows(fitted.setting, names, modules=modules, at=fitted.predicted).by_value
    reached = {system.number[o] for o in location.observers if o in system.number}
    for i, name in zip(own, names, strict=True):
        changed = {k: v for k, v in slopes[name].items() if np.any(np.nan_to_num(v))}
        if set(changed) == reached:
            shown = parameters.units[i], float(parameters.factors[i])
            way = parameter_at(location, f"parameter:{name}", name + CHANGE, *shown)
            found.append((way, rows.column(fitted.maps, changed)))
    return found


def parameter_at(
    location: DisturbanceLocation, id_: str, unknown: str, unit: str, factor: float
) -> DisturbanceLocation:
    """A parameter of the law at a place, as a place."""
    return replace(location, id=id_, kind="parameter", unit=unit, factor=factor, unknown=unknown)


def change_by(fitted: Fitted, candidate: Candidate) -> dict[int, Array]:
    """Change of each estimate by a joined candidate, shape (n,), m3/s, by number of the observer;
    without those that it does not change."""
    system, setting = fitted.rows.system, fitted.setting
    modules = system.reached(candidate.observers)
    there, plain = (
        system.flows(s, modules=modules, at=fitted.predicted).values
        for s in (setting, setting.leaving(candidate.id))
    )
    changes = enumerate(np.nan_to_num(there - plain))
    return {i: change for i, change in changes if np.any(change)}


def alike(fitted: Fitted, location: DisturbanceLocation) -> list[DisturbanceLocation]:
    """Other places at which an error has the same signature; none for a parameter of a law."""
    columns = {other.id: column_at(fitted, other) for other in fitted.rows.system.builder.locations}
    own, found = columns.pop(location.id, None), []
    for name, column in columns.items():
        if own is not None and column is not None:
            size = float(np.linalg.norm(own) * np.linalg.norm(column))
            if abs(float(own @ column)) > common.SAME_PATTERN * size:
                found.append(fitted.rows.system.builder.location_by_id[name])
    return found


def variables_of(system: System, module: str) -> dict[str, Array]:
    """Readings that may define a region, shape (n,), SI: those of the module, then those that no
    observer needs."""
    signals, used = system.ruleset.signal_by_id, {n for o in system.observers for n in o.signals}
    values = {n: v for n, v in system.data.values.items() if n in signals}
    own = {n: v for n, v in values.items() if n.partition(".")[0] == module}
    others = {n: v for n, v in values.items() if n not in own and n not in used}
    return {n: v for n, v in {**own, **others}.items() if np.isfinite(v).sum() > 8}


@dataclass(frozen=True, kw_only=True)
class InitialCandidate:
    """A candidate with starting values for a refit; `gain` in log likelihood, linearised."""

    candidate: Candidate
    values: Mapping[str, float]
    fixed: Mapping[str, float]
    gain: float
    course: Course | None = None

    def joined_to(self, setting: Configuration) -> Configuration:
        """A setting with the candidate joined."""
        return setting.joining(self.candidate, self.values, self.fixed, self.course)


@dataclass(frozen=True, kw_only=True)
class ScoreTest:
    """The weighted linear problem about a fit; the part that base values can explain is projected
    out.

    `pull` is the gradient of the priors there, in units of the weighted squares, shape (values,).
    """

    weights: Array
    residual: Array
    jacobian: Array
    inverse: Array
    pull: Array
    total: float
    count: int

    def best(self, columns: Array, lowest: Array, highest: Array) -> tuple[Array, float]:
        """Amplitudes within bounds, shape (k,), and the gain in log likelihood with free scale.

        `columns` have shape (rows, k).
        """
        whole = np.arange(columns.shape[1])[None]
        amplitudes, gains = self.best_of(columns, whole, lowest, highest)
        return amplitudes[0], float(gains[0])

    def best_of(
        self, columns: Array, sets: np.ndarray, lowest: Array, highest: Array
    ) -> tuple[Array, Array]:
        """The same for many sets of columns, given by numbers of shape (sets, k).

        Returns shapes (sets, k) and (sets,); `lowest` and `highest` are those of each column.
        """
        imitated = self.inverse @ (self.jacobian.T @ (self.weights[:, None] * columns))
        clean = columns - self.jacobian @ imitated
        normal = columns.T @ (self.weights[:, None] * clean)
        # A sensor error beyond its class is held by its prior, and a column that frees it gains.
        moment = clean.T @ (self.weights * self.residual) - imitated.T @ self.pull
        size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        # A column that base values imitate almost completely has no gain of its own.
        alone = np.einsum("nk,n,nk->k", columns, self.weights, columns)
        sound = (size**2 >= 1e-9 * alone) & np.isfinite(size)
        normal, size = np.where(np.outer(sound, sound), normal, 0.0), np.where(sound, size, 1.0)
        scaled = normal / np.outer(size, size) + 1e-9 * np.eye(len(size))
        block = (sets[:, :, None], sets[:, None, :])
        found = np.linalg.solve(scaled[block], np.where(sound, moment / size, 0.0)[sets][..., None])
        amplitudes = np.clip(-found[..., 0] / size[sets], lowest[sets], highest[sets])
        amplitudes = np.where(sound[sets].all(axis=1)[:, None], amplitudes, 0.0)
        fall = -2.0 * np.einsum("sk,sk->s", amplitudes, moment[sets])
        fall = fall - np.einsum("sk,skl,sl->s", amplitudes, normal[block], amplitudes)
        share = np.clip(fall / self.total, 0.0, 1.0 - 1e-9)
        return amplitudes, -0.5 * self.count * np.log1p(-share)


def score_tests_at(fitted: Fitted) -> tuple[ScoreTest, ScoreTest]:
    """Two tests: with the weights of the robust fit, and with more weight on outliers.

    The first finds small and frequent effects, the second large and rare ones.
    """
    rows, scale = fitted.rows, fitted.scale
    use = fitted.used[rows.point]
    size = np.sqrt(rows.per_group(fitted.residual**2) / rows.group_rank)[rows.group]
    huber = np.minimum(1.0, limits.HUBER * scale / np.maximum(size, 1e-300))
    robust = student_weights(rows, fitted.residual, scale)
    return _score_test(fitted, robust * use), _score_test(fitted, huber * use)


def _score_test(fitted: Fitted, weights: Array) -> ScoreTest:
    jacobian, at, prior = fitted.jacobian, fitted.at, fitted.local_prior
    unit = fitted.scale**2 * fitted.variance_inflation
    normal = jacobian.T @ (weights[:, None] * jacobian) / unit + prior.precision
    size = np.sqrt(np.maximum(np.diag(normal), 0.0))
    size = np.where(size > 0.0, size, 1.0)  # a value without any information has no scale
    inverse = np.linalg.pinv(normal / np.outer(size, size), hermitian=True)
    inverse = inverse / np.outer(size, size) / unit
    # The optimum with these weights differs from the fit: base values are refitted linearly.
    pull = unit * prior.precision @ (at - prior.mean)
    part = inverse @ (jacobian.T @ (weights * fitted.residual) + pull)
    residual = fitted.residual - jacobian @ part
    pull = pull - unit * prior.precision @ part
    # The negative log prior can fall too.
    strained = float(pull @ (at - part - prior.mean))
    total = float(np.sum(weights * residual**2)) + max(strained, 0.0)
    return ScoreTest(
        weights=weights,
        residual=residual,
        jacobian=jacobian,
        inverse=inverse,
        pull=pull,
        total=max(total, 1e-300),
        count=int(np.sum(weights > 0)),
    )


def screen(fitted: Fitted, candidates: Sequence[Candidate]) -> list[InitialCandidate]:
    """The best starting values of each candidate that gains, by falling gain."""
    tests = score_tests_at(fitted)
    trials = (_best_of(fitted, tests, candidate) for candidate in candidates)
    gaining = [trial for trial in trials if trial is not None and trial.gain > 0]
    return sorted(gaining, key=lambda t: (-t.gain, t.candidate.id))


def _best_of(
    fitted: Fitted, tests: Sequence[ScoreTest], candidate: Candidate
) -> InitialCandidate | None:
    system = fitted.rows.system
    if not has_drivers(system, candidate):
        return None
    fixed = references(system, candidate)
    amplitudes = [u for u in candidate.unknowns if u.null is not None and not u.fixed]
    best: InitialCandidate | None = None
    null = {u.id: u.null for u in amplitudes if u.null is not None}
    for shape, at in itertools.product(starts(system, candidate), _bends(amplitudes, null)):
        columns = columns_of(fitted, candidate, {**at, **shape}, fixed)
        if columns is None:
            continue
        low = np.array([u.lowest - null[u.id] for u in amplitudes])
        high = np.array([u.highest - null[u.id] for u in amplitudes])
        for test in tests:
            found, gain = test.best(columns, low, high)
            if best is None or gain > best.gain:
                own = zip(amplitudes, found, strict=True)
                values = {u.id: null[u.id] + float(a) for u, a in own} | shape
                best = InitialCandidate(candidate=candidate, values=values, fixed=fixed, gain=gain)
    return best


def _bends(
    amplitudes: Sequence[Unknown], null: Mapping[str, float]
) -> Iterator[Mapping[str, float]]:
    """Amplitudes at which to take the slope of a law: the null, and others where it may differ.

    An entry with starts of different sizes has a nonlinear law.
    """
    yield null
    for unknown in amplitudes:
        sizes = [abs(start - null[unknown.id]) for start in unknown.starts]
        if len(sizes) > 1 and max(sizes) > limits.BENT * min(sizes):
            yield {**null, unknown.id: max(unknown.starts, key=abs)}


def columns_of(
    fitted: Fitted, candidate: Candidate, values: Mapping[str, float], fixed: Mapping[str, float]
) -> Array | None:
    """Slopes of the residuals by the amplitudes of a candidate, shape (rows, amplitudes); None
    where all are 0."""
    rows, system = fitted.rows, fitted.rows.system
    names = [u.id for u in candidate.unknowns if u.null is not None and not u.fixed]
    setting = fitted.setting.joining(candidate, values, fixed)
    modules = system.reached(candidate.observers)
    flows = system.flows(setting, names, modules=modules, at=fitted.predicted)
    columns = np.stack([rows.column(fitted.maps, flows.by_value[n]) for n in names], axis=1)
    return columns if np.any(columns) else None


def has_drivers(system: System, candidate: Candidate) -> bool:
    """Are all drivers of a candidate recorded, and do they vary by more than their noise?

    A nonlinear law of a constant reading would only fit the noise of that reading.
    """
    data = system.data
    asked = (u.driver for u in candidate.unknowns if u.driver is not None)
    for name in dict.fromkeys((*candidate.drivers.values(), *asked)):
        if name == TIME:
            continue
        values = data.values.get(name)
        if values is None or not np.isfinite(values[data.open]).any():
            return False
        if np.nanstd(values[data.open]) < limits.DRIVER_VARIES * np.nanmedian(data.noise[name]):
            return False
    return any(o in system.number for o in candidate.observers)


def references(system: System, candidate: Candidate) -> dict[str, float]:
    """Fixed parameters by the open readings of their driver: the median or another quantile, or
    half the distance between two."""
    found = {}
    for unknown in candidate.unknowns:
        if unknown.fixed and len(unknown.quantiles) == 2:
            low, high = _readings(system, unknown, unknown.quantiles)
            found[unknown.id] = 0.5 * (high - low) or 1.0
        elif unknown.fixed:
            found[unknown.id] = _readings(system, unknown, unknown.quantiles or MEDIAN)[0]
    return found


def with_open_references(
    system: System, setting: Configuration, new: Iterable[Candidate]
) -> Configuration | None:
    """A setting in which laws of `new` have free reference conditions; None where none has any.

    A calibration on an earlier run may have had other conditions than this recording.
    """
    there = None
    for candidate in new:
        free = {u.id: _as_unknown(system, u) for u in candidate.unknowns if u.fixed and u.neutral}
        if not free or setting.in_periods & {u.id for u in candidate.unknowns}:
            continue
        unknowns = tuple(free.get(u.id, u) for u in candidate.unknowns)
        values = {u.id: setting.values[u.id] for u in unknowns if u.id in setting.values}
        values |= {n: v for n, v in setting.fixed.items() if n in free}
        fixed = {n: v for n, v in setting.fixed.items() if n not in free}
        bare = (there or setting).leaving(candidate.id)
        there = bare.joining(replace(candidate, unknowns=unknowns), values, fixed)
    return there


def _as_unknown(system: System, unknown: Unknown) -> Unknown:
    """A reference as an unknown, within the readings of its driver and half their span beyond."""
    low, middle, high = _readings(system, unknown, (0.0, 0.5, 1.0))
    beyond = 0.5 * (high - low)
    # A positive reference stays positive.
    lowest = max(low - beyond, limits.NEAR_ZERO * middle) if low > 0.0 else low - beyond
    free = replace(unknown, fixed=False, lowest=lowest, highest=high + beyond)
    derived = system.builder.fluid_drivers.get(unknown.driver or "")
    if derived is not None:
        return replace(free, unit=derived.unit.text, factor=derived.unit.factor)
    signal = system.ruleset.signal_by_id.get(unknown.driver or "")
    if signal is None:
        return free
    return replace(free, unit=signal.unit, factor=signal.factor, offset=signal.offset)


def starts(system: System, candidate: Candidate) -> Iterator[dict[str, float]]:
    """Combinations of values for the parameters that only shape a term."""
    shapes = [u for u in candidate.unknowns if u.null is None and not u.fixed]
    grids = [_grid(system, u) for u in shapes]
    for combination in itertools.islice(itertools.product(*grids), limits.MOST_STARTS):
        yield {u.id: v for u, v in zip(shapes, combination, strict=True)}


def _grid(system: System, unknown: Unknown) -> list[float]:
    values = list(unknown.starts)
    if unknown.driver is not None and unknown.quantiles:
        values += _readings(system, unknown, unknown.quantiles)
    return [float(np.clip(v, unknown.lowest, unknown.highest)) for v in dict.fromkeys(values)]


def _readings(system: System, unknown: Unknown, quantiles: Sequence[float]) -> list[float]:
    """Quantiles of the open readings of a parameter's driver."""
    data = system.data
    assert unknown.driver is not None
    values = data.clock if unknown.driver == TIME else data.values[unknown.driver]
    values = values[data.open & np.isfinite(values)]
    return [float(v) for v in np.quantile(values, quantiles)] if len(values) else []
