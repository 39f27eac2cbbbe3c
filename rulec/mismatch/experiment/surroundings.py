"""What nobody sets, such as a temperature, as it can be expected where set points are changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.steady.system import System


def unset(system: System, set_: Sequence[str]) -> tuple[str, ...]:
    """Readings that are neither set nor caused by what is set, as far as any law says."""
    signals = system.ruleset.signal_by_id
    caused = {s for o in system.observers for s in o.signals if not signals[s].is_input}
    return tuple(
        n for n in system.data.values if n not in caused and n not in set_ and n in signals
    )


def surroundings(
    recorded: Mapping[str, Array], time: Array, names: Sequence[str], inputs: Mapping[str, Array]
) -> dict[str, Array]:
    """Values of some readings at other inputs, shape (n,) each.

    They stay as they were last, but for what of them followed the inputs in the recording, by
    linear least squares: a temperature may follow the load, and it may be any other by tomorrow,
    but it is not what it was when a set point was last seen. None leaves what was recorded.
    """
    # A sensor that fails shows nothing at all.
    names = [n for n in names if np.isfinite(recorded[n]).any()]
    known = {n: np.asarray(recorded[n]) for n in (*names, *inputs)}
    usable = np.all([np.isfinite(values) for values in known.values()], axis=0)
    table = np.stack([known[n][usable] for n in inputs], axis=1)
    last, middle = table[int(np.argmax(time[usable]))], table.mean(axis=0)
    moved = np.stack([np.asarray(v) for v in inputs.values()], axis=1) - last
    found = {}
    for name in names:
        values = known[name][usable]
        slopes = np.linalg.lstsq(table - middle, values - values.mean(), rcond=1e-6)[0]
        there = values[int(np.argmax(time[usable]))] + moved @ slopes
        found[name] = np.clip(there, values.min(), values.max())
    return found
