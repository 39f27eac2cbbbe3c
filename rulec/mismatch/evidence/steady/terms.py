"""Terms without a name at settled points: places, drivers, and what switches.

Source: Mayergoyz 2003 (a law with memory has branches).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import Changing, variables_of, ways_at
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.evidence.term import Basis, Switching, Term, basis_over, term_with, ways_there


def driver_of(system: System, name: str) -> Array:
    """Values of a driver at all points, shape (n,), SI; NaN where it was not read."""
    return system.data.time if name == TIME else system.data.values[name]


def term_of(
    rows: Rows,
    open_: NDArray[np.bool_],
    location: str,
    changing: Changing,
    driver: str,
    basis: Basis | Switching,
) -> Term | None:
    """A term with functions of a driver; None where it does not show.

    `location` is its id; `open_` flags the rows that count.
    """
    (changed, slopes), values = changing, driver_of(rows.system, driver)
    filled = np.nan_to_num(values, nan=float(np.nanmedian(values)))[rows.point[open_]]
    table = slopes[open_][:, None] * basis.at(filled)
    return term_with(table, location, changed, driver, basis, slopes[open_])


def terms_at(fitted: Fitted, open_: NDArray[np.bool_]) -> list[Term]:
    """Terms for each place and each driver that a model does not predict."""
    rows, system = fitted.rows, fitted.rows.system
    found: list[Term | None] = []
    for location in system.builder.locations:
        if not (ways := ways_at(fitted, location)):
            continue
        drivers = varying(fitted, location.module)
        inputs = [name for name in drivers if system.ruleset.signal_by_id[name].is_input]
        for way in ways if system.data.timed else ():
            turns = (turn for name in inputs for turn in _by_the_way(system, name))
            bases = [*_over(system, TIME), *turns]
            found += [term_of(rows, open_, location.id, way, TIME, basis) for basis in bases]
        for name in drivers:
            bases = _over(system, name)
            found += [term_of(rows, open_, location.id, ways[0], name, basis) for basis in bases]
    return [term for term in found if term is not None]


def _over(system: System, driver: str) -> list[Basis | Switching]:
    """Functions of a driver: a resonance in a band of it, an unrecorded one in a band of time."""
    values = driver_of(system, driver)
    return [basis_over(values, length) for length in limits.TERM_LENGTHS]


def _by_the_way(system: System, driver: str) -> Iterator[Switching]:
    """Functions of time that differ by whether an input rose or fell to its value, if it did both.

    Its direction before the first move is not known: both are tried.
    """
    data = system.data
    side, _ = ways_there(data.values[driver], float(np.nanmedian(data.noise[driver])))
    if not {-1.0, 1.0} <= set(side.tolist()):
        return
    says = f"is not the same after {driver} rose as after it fell: a law with memory, such as play"
    for before in (-1.0, 1.0):
        came = np.where(side == 0.0, before, side)
        ends = np.flatnonzero(np.diff(came) != 0) + 1
        yield Switching(data.time[ends], came[np.append(0, ends)], says, float(np.log(2.0)))


def varying(fitted: Fitted, module: str) -> list[str]:
    """Possible drivers: readings given from outside that vary by more than their noise.

    A reading that the model predicts follows any error, and so explains nothing.
    """
    system, data = fitted.rows.system, fitted.rows.system.data
    read = {name for o in system.observers for name in o.signals}
    names = []
    for name, values in variables_of(system, module).items():
        signal, noise = system.ruleset.signal_by_id[name], data.noise.get(name)
        given = signal.is_input or (name not in read and not _is_flow(system, name))
        if noise is None or not given:
            continue
        spread = float(np.nanstd(values[data.open]))
        if spread > common.FEATURE_VARIES * float(np.nanmedian(noise)):
            names.append(name)
    return names


def _is_flow(system: System, name: str) -> bool:
    """Is a reading a flow that the estimates of its module predict?"""
    flows = system.flows(Configuration())
    values = system.data.values[name]
    own = [i for i, o in enumerate(system.observers) if o.module == name.partition(".")[0]]
    used = system.data.open & np.isfinite(values)
    for i in own:
        there = used & np.isfinite(flows.values[i]) & system.valid[i]
        ratio = values[there] / flows.values[i][there]
        if len(ratio) and abs(float(np.median(ratio)) - 1.0) < limits.SAME_FLOW:
            return True
    return False
