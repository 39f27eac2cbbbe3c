"""Which faults of a plant that stores its readings can show: the balances simulated once.

Inputs swing around their reference, so that every fault has a characteristic course; sensors have
no noise but their resolution. A fault is detectable by what initial states and lasting errors
cannot explain of it.
"""

from collections.abc import Set
from functools import partial

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Dynamics, Ruleset
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.free_balances import nominal_starts
from rulec_runtime.diagnosis.stores.window_fit import model_of
from rulec_runtime.diagnosis.stores.windows import Window
from rulec_runtime.recordings.stationary import systematic_u
from rulec_runtime.simulation.balances import RanAway


def information_of(ruleset: Ruleset) -> partial[Array]:
    """What readings without some lost signals say about all faults: see `Sighted`. The balances
    are simulated from their nominal start."""
    dynamics = ruleset.dynamics
    assert dynamics is not None
    signals = [ruleset.signal_by_id[name] for name in dynamics.outputs]
    level = np.array([signal.reference for signal in signals])
    spread = np.array([common.NO_CHANGE * float(systematic_u(s, s.reference)) for s in signals])
    spread = np.where(spread > 0.0, spread, 1.0)
    model = model_of(ruleset, spread, level)
    unknown = np.zeros(len(model.errors) + len(dynamics.faults))
    unknowns = np.append(nominal_starts(dynamics), unknown)
    try:
        _, slopes, _ = model.simulate(swinging(ruleset, dynamics), unknowns, dynamics.faults)
    except RanAway:
        return partial(_information, dynamics, None, model.states)
    return partial(_information, dynamics, slopes / spread[:, None], model.states)


def _information(
    dynamics: Dynamics, slopes: Array | None, states: int, lost: Set[str], still: Set[str]
) -> Array:
    """`slopes` of the outputs, in standard deviations, by initial `states`, lasting errors and
    degrees: shape (samples, outputs, unknowns). Without any, every fault counts as detectable while
    all inputs and some output are there. Balances hold at standstill as well."""
    there = [i for i, name in enumerate(dynamics.outputs) if name not in lost]
    count = len(dynamics.faults)
    if not lost.isdisjoint(dynamics.inputs) or not there:
        return np.zeros((count, count))
    if slopes is None:
        return np.diag(np.full(count, np.inf))
    table = slopes[:, there].reshape(-1, slopes.shape[2])
    own, effect = np.split(table, [table.shape[1] - count], axis=1)
    # By least squares with the prior as rows: differences of squares would hide a fault beside a
    # parameter that its sheet alone limits.
    prior = np.eye(own.shape[1])[states:]
    own, effect = np.vstack([own, prior]), np.vstack([effect, np.zeros((len(prior), count))])
    norm = np.linalg.norm(own, axis=0)
    own = own / np.where(norm > 0.0, norm, 1.0)
    rest = effect - own @ np.linalg.lstsq(own, effect)[0]
    left: Array = rest.T @ rest
    size = np.linalg.norm(effect, axis=0)
    shown = np.sqrt(np.diag(left)) > limits.UNDETECTABLE_EFFECT * size
    return np.where(np.outer(shown, shown), left, 0.0)


def swinging(ruleset: Ruleset, dynamics: Dynamics) -> Window:
    """A window without readings in which each input swings at a pace of its own."""
    n = limits.SIGNATURE_SAMPLES
    time: Array = np.arange(n, dtype=np.float64) * limits.SIGNATURE_STEP
    level = np.array([ruleset.signal_by_id[name].reference for name in dynamics.inputs])
    pace = limits.SIGNATURE_PACE + limits.SIGNATURE_PACES_APART * np.arange(len(level))
    inputs = level * (1.0 + limits.SIGNATURE_SWING * np.sin(time[:, None] / pace))
    return Window(time=time, inputs=inputs, measured=np.zeros((n, len(dynamics.outputs))))
