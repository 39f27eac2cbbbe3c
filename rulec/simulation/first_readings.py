"""Initial states of a recording: the inverse of the sensors' laws at the first readings.

Source: Gauss-Newton; propagation of uncertainty (GUM, JCGM 100:2008, 5.1.2).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.contract.ruleset import Dynamics, Ruleset, StateSpec
from rulec_runtime.recordings.recording_file import RecordingFile
from rulec_runtime.recordings.stationary import systematic_u

from rulec.algebra.tangent import run_with_slopes
from rulec.simulation import limits
from rulec.simulation.equations import SimulationRefused

SHOWN, START = "shown:", "start:"


@dataclass(frozen=True)
class First:
    """A reading at the beginning of a recording, with its standard uncertainty, SI."""

    signal: str
    value: float
    u: float


@dataclass(frozen=True)
class Starts:
    """Values of the parameters from which states start, SI, and remarks for the user."""

    values: Mapping[str, float]
    notes: tuple[str, ...]


def starts_of(ruleset: Ruleset, recording: RecordingFile) -> Starts:
    """Initial states of a plant by the first readings of a recording.

    A state that no reading determines starts as stated, and a note says so. Raises
    `SimulationRefused` if the plant stores nothing, if the recording has no reading of a state, or
    if no state reproduces the readings.
    """
    dynamics = ruleset.dynamics
    if dynamics is None:
        raise SimulationRefused(
            f"{ruleset.plant} has no storage, so no first reading gives a start; leave out --start"
        )
    first, notes = _first_readings(ruleset, dynamics, recording)
    if not first:
        raise SimulationRefused(
            f"{recording.path}: no usable first reading of {' or '.join(dynamics.outputs)}, so it "
            "tells no start; give a recording with one of them, or leave out --start"
            + "".join(f" ({note})" for note in notes)
        )
    return _solved(dynamics, recording, first, notes)


def _first_readings(
    ruleset: Ruleset, dynamics: Dynamics, recording: RecordingFile
) -> tuple[list[First], list[str]]:
    """Readings of states at the first moment, and notes on those left out."""
    timed = np.flatnonzero(np.isfinite(recording.time))
    order = timed[np.argsort(recording.time[timed], kind="stable")][: limits.FIRST_SAMPLES]
    time = recording.time[order] - recording.time[order[:1]]
    found: list[First] = []
    notes: list[str] = []
    for name in dynamics.outputs:
        values = recording.values[name][order] if name in recording.values else np.zeros(0)
        there = np.isfinite(values)
        if not there.any():
            continue
        signal = ruleset.signal_by_id[name]
        value, u = _at_first(time[there], values[there])
        low, high = signal.ends
        if not low < float(np.median(values[there])) < high:
            notes.append(f"{name} begins at an end of its sensor's range, which tells no start")
            continue
        found.append(First(name, value, float(np.hypot(u, systematic_u(signal, value)))))
    return found, notes


def _at_first(time: Array, values: Array) -> tuple[float, float]:
    """The value at `time` 0 by the first readings, and its standard uncertainty.

    A moving quantity would make their mean late. Of mean, straight line and parabola, the
    Bayesian information criterion selects one (Schwarz 1978).
    """
    n, length = len(values), float(np.ptp(time))
    found = []
    for order in range(limits.FIRST_ORDER + 1):
        if order and (n < order + 3 or length <= 0.0):
            break
        table = np.vander(time / length if length > 0.0 else time, order + 1, increasing=True)
        curve = np.linalg.lstsq(table, values, rcond=None)[0]
        left = float(np.sum((values - table @ curve) ** 2))
        variance = left / max(n - order - 1, 1) * float(np.linalg.inv(table.T @ table)[0, 0])
        score = n * float(np.log(max(left / n, 1e-300))) + (order + 1) * float(np.log(n))
        found.append((score, float(curve[0]), float(np.sqrt(variance))))
    _, value, u = min(found)
    return value, u


def _solved(
    dynamics: Dynamics, recording: RecordingFile, first: Sequence[First], notes: Sequence[str]
) -> Starts:
    own = _own_parameters(dynamics)
    states = [s for s in dynamics.states if s.id in own]
    ids = [s.id for s in states]
    shown = dynamics.plan.select([f"{SHOWN}{f.signal}" for f in first])
    given = _given(dynamics, recording)
    at = {**given, **_stated(dynamics, given)}
    measured, u = (np.array([getattr(f, key) for f in first]) for key in ("value", "u"))
    u = np.maximum(u, 1e-9 * np.maximum(np.abs(measured), 1e-300))
    inverse, table = np.zeros((len(ids), len(first))), np.zeros((len(first), len(ids)))
    for _ in range(limits.START_STEPS):
        predicted, table = _with_slopes(shown, at, first, ids)
        inverse = np.linalg.pinv(table / u[:, None]) / u if ids else inverse
        step = inverse @ (measured - predicted)
        if not np.isfinite(step).all():
            names = ", ".join(f.signal for f in first)
            raise SimulationRefused(
                f"{recording.path}: nothing stored gives the first readings of {names}; check "
                "their units, and the values of the sensors' laws"
            )
        at |= {name: at[name] + float(s) for name, s in zip(ids, step, strict=True)}
        if np.all(np.abs(table @ step) <= 1e-9 * np.maximum(np.abs(measured), u)):
            break
    uncertain = [n for n, own_u in dynamics.uncertainties.items() if own_u > 0]
    _, by_values = _with_slopes(shown, at, first, uncertain)
    by_values = by_values * np.array([dynamics.uncertainties[n] for n in uncertain])
    spread = np.sqrt(np.sum((inverse * u) ** 2, axis=1))
    spread = np.hypot(spread, np.sqrt(np.sum((inverse @ by_values) ** 2, axis=1)))
    # A state that readings determine only together with another one has no start of its own.
    alone = np.abs(np.diag(inverse @ table) - 1.0) < 1e-6
    values: dict[str, float] = {}
    remarks = [f"{recording.path.name}: {note}" for note in notes]
    for i, state in enumerate(states):
        readers = [f.signal for f, slope in zip(first, table[:, i], strict=True) if slope]
        if not alone[i]:
            continue
        level, end = _limited(dynamics, state.id, at)
        values[own[state.id]] = _inverted(dynamics, state.id, own[state.id], given, level)
        remarks.append(
            f"{recording.path.name}: {state.title} starts at {_shown(state, level, spread[i])} by "
            f"the first readings of {', '.join(readers)}{end}"
        )
    remarks += _as_stated(dynamics, recording, own, values, given)
    return Starts(values, tuple(remarks))


def _own_parameters(dynamics: Dynamics) -> dict[str, str]:
    """The parameter from which each state starts, for those that occur nowhere else."""
    plan = dynamics.plan
    elsewhere = plan.select([n for n in plan.outputs if not n.startswith(START)]).used_inputs
    found = {}
    for state in dynamics.states:
        used = set(plan.select([f"{START}{state.id}"]).used_inputs)
        if len(used) == 1 and used <= dynamics.values.keys() and not used.intersection(elsewhere):
            (found[state.id],) = used
    return found


def _given(dynamics: Dynamics, recording: RecordingFile) -> dict[str, float]:
    """All inputs of the laws at the beginning of the recording except states; without faults."""
    given: dict[str, float] = {"time": 0.0, **dynamics.values}
    given |= {f"x.{name}": 0.0 for name in dynamics.faults}
    for name in dynamics.inputs:
        values = recording.values.get(name, np.zeros(0))
        values = values[np.isfinite(values)]
        given[name] = float(values[0]) if len(values) else np.nan
    return given


def _stated(dynamics: Dynamics, given: Mapping[str, float]) -> dict[str, float]:
    """All states at their stated start."""
    plan = dynamics.plan.select([f"{START}{s.id}" for s in dynamics.states])
    at: dict[str, float] = {}
    # The start of a state may depend on that of another one.
    for _ in dynamics.states:
        out, _ = run_with_slopes(plan, {**given, **at}, ())
        at = {s.id: float(out[f"{START}{s.id}"]) for s in dynamics.states}
    return at


def _with_slopes(
    shown: Plan, at: Mapping[str, float], first: Sequence[First], by: Sequence[str]
) -> tuple[Array, Array]:
    """Predicted readings, shape (readings,), and their slopes, shape (readings, by)."""
    out, slopes = run_with_slopes(shown, at, by)
    predicted = np.array([float(out[f"{SHOWN}{f.signal}"]) for f in first])
    table = [[float(slopes[f"{SHOWN}{f.signal}"].get(n, 0.0)) for n in by] for f in first]
    return predicted, np.array(table).reshape(len(first), len(by))


def _limited(dynamics: Dynamics, state: str, at: Mapping[str, float]) -> tuple[float, str]:
    """The value of a state limited to its range, and a remark if it is outside."""
    value = at[state]
    for end, beyond in (("low", np.less), ("high", np.greater)):
        name = f"{end}:{state}"
        if name in dynamics.plan.outputs:
            limit = float(run_with_slopes(dynamics.plan.select([name]), at, ())[0][name])
            if beyond(value, limit):
                return limit, "; beyond that it cannot be"
    return value, ""


def _inverted(
    dynamics: Dynamics, state: str, parameter: str, given: Mapping[str, float], value: float
) -> float:
    """The value of a parameter at which a state starts at `value`."""
    plan, name, there = dynamics.plan, f"{START}{state}", given[parameter]
    for _ in range(limits.START_STEPS):
        out, slopes = run_with_slopes(plan.select([name]), {**given, parameter: there}, [parameter])
        there += (value - float(out[name])) / float(slopes[name][parameter])
    return there


def _as_stated(
    dynamics: Dynamics,
    recording: RecordingFile,
    own: Mapping[str, str],
    values: Mapping[str, float],
    given: Mapping[str, float],
) -> Iterator[str]:
    """A remark for each state that no reading determines."""
    at = _stated(dynamics, {**given, **values})
    for state in dynamics.states:
        if own.get(state.id) in values:
            continue
        u = dynamics.uncertainties.get(own.get(state.id, ""), 0.0)
        yield (
            f"{recording.path.name}: no sensor reads {state.title} alone; it starts at "
            f"{_shown(state, at[state.id], u)} as stated"
        )


def _shown(state: StateSpec, value: float, u: float) -> str:
    return f"{(value - state.offset) / state.factor:.4g} ± {u / state.factor:.2g} {state.unit}"
