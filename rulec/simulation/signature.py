"""How faults of a plant that stores change its readings, and which do so alike."""

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.stores.detectable_faults import swinging
from rulec_runtime.diagnosis.stores.free_balances import nominal_starts, with_free_states
from rulec_runtime.diagnosis.stores.window_fit import Model
from rulec_runtime.simulation.balances import RanAway

from rulec.simulation import limits


@dataclass(frozen=True)
class Signature:
    """Signs of effects, a row per fault, and groups of faults with proportional effects."""

    readings: tuple[str, ...]
    faults: tuple[str, ...]
    signs: tuple[tuple[int, ...], ...]
    alike: tuple[tuple[str, ...], ...]


def signature_of(ruleset: Ruleset) -> Signature | None:
    """Integrate the balances from their nominal start; None if a state grows without bound."""
    dynamics = ruleset.dynamics
    assert dynamics is not None
    window = swinging(ruleset, dynamics)
    model = Model(ruleset, (), np.ones(len(dynamics.outputs)), with_free_states(dynamics))
    starts = nominal_starts(dynamics)
    unknowns = np.append(starts, np.zeros(len(dynamics.faults)))
    try:
        _, slopes, _ = model.simulate(window, unknowns, dynamics.faults)
    except RanAway:
        return None
    effects = slopes[:, :, len(starts) :]
    size = np.abs(effects).max(axis=(0, 2), initial=0.0)
    size = np.where(size > 0, size, 1.0)[:, None]
    mean = effects[len(window.time) // 2 :].mean(axis=0) / size
    signs = np.where(np.abs(mean) > limits.SAME_EFFECT, np.sign(mean), 0.0).astype(int).T
    columns = (effects / size).reshape(-1, len(dynamics.faults))
    return Signature(
        dynamics.outputs,
        dynamics.faults,
        tuple(tuple(row) for row in signs.tolist()),
        _alike(dynamics.faults, columns),
    )


def _alike(faults: tuple[str, ...], columns: np.ndarray) -> tuple[tuple[str, ...], ...]:
    """Groups of faults whose effects have the same course and the same sign."""
    length = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(length > 0, length, 1.0)
    left, groups = [i for i in range(len(faults)) if length[i] > 0], []
    while left:
        own = [i for i in left if unit[:, i] @ unit[:, left[0]] > 1.0 - limits.SAME_EFFECT]
        left = [i for i in left if i not in own]
        if len(own) > 1:
            groups.append(tuple(faults[i] for i in own))
    return tuple(groups)
