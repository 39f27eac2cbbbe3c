"""Judge results of modules instead of their readings.

If the file holds mean readings as well, faults are undone in the equations of the ruleset, as in a
recording. If not, they are undone by the slopes by degree, which holds for small faults only.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array, Operation, Plan
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, in_order, judged_parts
from rulec_runtime.diagnosis.hidden_faults import blind_between
from rulec_runtime.diagnosis.steady.batch_means import Halves
from rulec_runtime.diagnosis.steady.evaluated_points import evaluate_part
from rulec_runtime.diagnosis.steady.independent_parts import parts_of
from rulec_runtime.diagnosis.steady.observe import Observed, slope_names, with_errors
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.recordings.columns import runs_where
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.module_results import ModuleResults
from rulec_runtime.recordings.stationary import Timeline

UNFIT = "its module says that it is not fit"
FIRST_ORDER = (
    "the results hold no mean readings: faults are undone to first order in their degrees, which "
    "holds for small ones alone"
)


def diagnose_results(results: ModuleResults, ruleset: Ruleset) -> Diagnosis:
    """Judge results of modules; raises `RecordingRefused` where they do not suffice."""
    if ruleset.dynamics is not None:
        raise RecordingRefused(
            "this plant has storage: its balances are judged by readings, not by results of "
            "modules; diagnose a recording"
        )
    notes = [*results.notes, *_unfit(results, ruleset)]
    points = points_of(results, ruleset)
    missing = sorted(ruleset.observed - points.values.keys())
    if missing:
        notes.append(FIRST_ORDER)
        inverse = first_order(ruleset, results)
        # Modules give slopes by listed faults only.
        ruleset = replace(ruleset, undo=inverse, unlisted=(), unlisted_cells=())
        points = replace(points, values={**points.values, **results.columns})
    halves = halves_of_results(results, ruleset)
    evaluated = [
        evaluate_part(ruleset, part, points, "default", halves, observed=observed)
        for part in parts_of(ruleset)
        for observed in (observed_of(results, part.ruleset, points),)
    ]
    judged, found = judged_parts(ruleset, timeline_of_results(results), evaluated)
    lost = {name: runs for name, flags in points.bad.items() if (runs := runs_where(flags, 1))}
    still = {
        s.id: runs_where(results.readings[s.id] < s.minimum, 1)
        for s in ruleset.signals
        if s.minimum is not None and s.id in results.readings
    }
    times = results.since, results.until
    return in_order(
        ruleset,
        "default",
        samples=int(results.samples.sum()),
        judged=judged,
        found=found,
        notes=tuple(notes),
        calendar=results.calendar,
        blind=blind_between(ruleset, times, lost, still, points.why),
    )


def points_of(results: ModuleResults, ruleset: Ruleset) -> Points:
    """Uncertainties of readings, and those readings that the file has."""
    values, u, systematic, bad, why, lag = {}, {}, {}, {}, {}, {}
    for signal in (s for s in ruleset.signals if s.id in ruleset.observed):
        name = signal.id
        bad[name] = ~results.flags(f"fit:{name}")
        why[name] = UNFIT
        lasting = np.where(bad[name], np.nan, results.columns[f"systematic:{name}"])
        noise = abs(signal.factor) * results.columns[f"noise:{name}"]
        systematic[name] = lasting
        u[name] = np.hypot(lasting, noise)
        if name in results.readings:
            values[name] = np.where(bad[name], np.nan, results.readings[name])
        moved = results.columns.get(f"lag:{name}")
        if moved is not None and np.any(moved):
            lag[name] = np.nan_to_num(moved)
    middle = 0.5 * (results.since + results.until)
    return Points(values, u, systematic, bad, why, middle, lag)


def observed_of(results: ModuleResults, ruleset: Ruleset, points: Points) -> Observed:
    """Estimates of modules, with their covariances."""
    columns = results.columns
    flows = np.array([columns[f"q:{o.id}"] for o in ruleset.observers])
    valid = np.array([results.flags(f"valid:{o.id}") for o in ruleset.observers])
    valid &= np.isfinite(flows)
    row = ruleset.observer_index
    # Slopes of unusable estimates do not matter, and may be anything.
    slopes = {
        name: np.where(valid[row[name.split(":")[1]]], columns[name], 0.0)
        for name in slope_names(ruleset)
    }
    observed = with_errors(ruleset, points, np.where(valid, flows, np.nan), valid, slopes)
    beyond = {s.id: results.flags(f"beyond:{s.id}") for s in ruleset.signals}
    return replace(observed, extrapolated={n: flags for n, flags in beyond.items() if flags.any()})


def halves_of_results(results: ModuleResults, ruleset: Ruleset) -> Halves:
    """Differences between the halves of windows; NaN if modules do not give them."""
    none = np.full(len(results), np.nan)
    apart = [results.columns.get(f"apart:{o.id}", none) for o in ruleset.observers]
    early = results.samples // 2
    with np.errstate(divide="ignore"):
        excess: Array = results.samples**2 / (early * (results.samples - early))
    return Halves(np.array(apart), excess)


def timeline_of_results(results: ModuleResults) -> Timeline:
    """Times of the windows; the time between them was not judged."""
    after = np.cumsum(results.samples[::-1])[::-1] - results.samples
    paused = np.zeros(len(results), dtype=bool)
    interval = np.median((results.until - results.since) / np.maximum(results.samples - 1, 1))
    pause = limits.LONGEST_STRETCH * interval if interval > 0.0 else np.inf
    paused[1:] = results.since[1:] - results.until[:-1] > pause
    return Timeline(results.since, results.until, results.samples, after, paused)


def first_order(ruleset: Ruleset, results: ModuleResults) -> Plan:
    """Estimates with faults undone as linear functions of the degrees: ``q + dq x``.

    Its inputs are the modules' estimates and slopes, and the degrees.
    """
    listed = {fault.id for fault in ruleset.faults}
    slopes = [n for n in ruleset.undo.outputs if n.startswith("dq:") and _fault(n) in listed]
    if lost := [n for n in slopes if n not in results.columns]:
        raise RecordingRefused(
            f"the results hold neither all mean readings nor the column '{lost[0]}': faults cannot "
            "be undone"
        )
    flows = [f"q:{o.id}" for o in ruleset.observers]
    degrees = [n for n in ruleset.undo.inputs if n.removeprefix("x:") in listed]
    inputs = [*flows, *slopes, *degrees]
    index = {name: i for i, name in enumerate(inputs)}
    operations: list[Operation] = []
    outputs = {name: index[name] for name in (*slopes, *flows)}
    for slope in slopes:
        flow, degree = f"q:{slope.split(':')[1]}", f"x:{_fault(slope)}"
        if flow in outputs and degree in index:
            last = len(inputs) + len(operations)
            operations.append(("mul", index[slope], index[degree]))
            operations.append(("add", outputs[flow], last))
            outputs[flow] = last + 1
    return Plan(tuple(inputs), (), tuple(operations), outputs)


def _fault(slope: str) -> str:
    return slope.split(":", 2)[2]


def _unfit(results: ModuleResults, ruleset: Ruleset) -> Iterator[str]:
    for name in sorted(ruleset.observed):
        count = int((~results.flags(f"fit:{name}")).sum())
        if count:
            yield f"{name}: {UNFIT} in {count} of {len(results)} windows"
