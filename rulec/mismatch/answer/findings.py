"""From numbers to findings: parameters as shown, sentences, alternatives, places."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import percent

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits
from rulec.mismatch.answer.shapes import shape_of
from rulec.mismatch.answer.wording import quantity
from rulec.mismatch.evidence.configuration import HIDDEN
from rulec.mismatch.evidence.model import Model, Variable, periods_of, region_of
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.inference.heldout_errors import profile
from rulec.mismatch.result import (
    Alternative,
    Estimate,
    Finding,
    Location,
    Moved,
    OfRecording,
    Period,
    Update,
)
from rulec.mismatch.search.curve_found import Accepted, CurveFound
from rulec.mismatch.search.later_refits import ByRecording

MOVED = 3
"""Most explanations in the sentence on a further recording."""


def findings_of(model: Model, accepted: Sequence[Accepted]) -> tuple[Finding, ...]:
    """Named explanations that were accepted, by the share that they explain."""
    shares = shares_of(accepted)
    named = (own for own in accepted if own.candidate.sort != HIDDEN)
    found = [_finding(model, own, shares[own.candidate.id]) for own in named]
    return tuple(sorted(found, key=lambda f: -f.closed))


def shares_of(accepted: Sequence[Accepted]) -> dict[str, float]:
    """Each explanation's share of the total gain."""
    total = sum(own.gain for own in accepted) or 1.0
    return {own.candidate.id: own.gain / total for own in accepted}


def _finding(model: Model, own: Accepted, share: float) -> Finding:
    candidate = _joined(model, own.candidate.id)
    parameters = {}
    for one in (u for u in candidate.unknowns if not u.fixed and u.id in model.free):
        line = model.line(one.id)
        low, high = profile(line)
        u = max(line.least, (high - low) / (2.0 * limits.NORMAL_95)) / one.factor
        value, *ends = ((v - one.offset) / one.factor for v in (line.value, low, high))
        parameters[one.name] = Estimate(one.title, value, u, min(ends), max(ends), one.unit)
    periods = model.periods(candidate, parameters)
    others = [
        Alternative(
            c.id, c.name, titled(model.ruleset, c), odds * own.probability, c.id in own.same
        )
        for c, odds in own.others
        if odds * own.probability > limits.REPORTED or c.id in own.same
    ]
    ids = tuple(c.id for c in model.joined if c.sort != HIDDEN)
    return Finding(
        id=candidate.id,
        sort=candidate.sort,
        name=candidate.name,
        title=candidate.title,
        module=candidate.module,
        place=candidate.place,
        parameters=parameters,
        equation=model.builder.equation(candidate.module, ids, candidate.place),
        text=sentence(candidate, parameters, periods),
        action=candidate.action,
        source=candidate.source,
        probability=own.probability,
        alternatives=tuple(sorted(others, key=lambda a: -a.probability)),
        gain=own.gain,
        rivals=own.rivals,
        periods=periods,
        closed=share,
        members=candidate.members,
        shapeless=own.shapeless * own.probability,
        inexact=own.inexact,
    )


def _joined(model: Model, name: str) -> Candidate:
    """An explanation in its final form, in which it may have more unknowns than at first."""
    return next(c for c in model.joined if c.id == name)


def titled(ruleset: Ruleset, candidate: Candidate) -> str:
    """An explanation and its place, in a few words; a title that names a reading is enough."""
    if f"{candidate.module}." in candidate.title:
        return candidate.title
    module = ruleset.modules.get(candidate.module, candidate.module)
    where = ", ".join(candidate.members) or f"{candidate.module}: {module}"
    return f"{candidate.title} ({where}, {candidate.place})"


def sentence(
    candidate: Candidate, parameters: Mapping[str, Estimate], periods: tuple[Period, ...]
) -> str:
    """The sentence for the operator with its slots filled; ``{k:%}`` gives a share in per cent."""
    slots: dict[str, str] = {}
    for unknown in candidate.unknowns:
        changing = periods and not unknown.fixed
        shown = shown_percent = _of_periods(periods) if changing else unknown.title
        if (e := parameters.get(unknown.name)) is not None:
            shown = quantity(e.value, e.u, e.unit)
            shown_percent = quantity(100.0 * e.value, 100.0 * e.u, f"%{e.unit[1:]}")
        slots |= {unknown.name: shown, f"{unknown.name}:%": shown_percent}
    slots |= {"degree": slots.get("x", ""), "where": candidate.place}
    text = candidate.text
    for name, value in slots.items():
        text = text.replace("{" + name + "}", value)
    return text


def _of_periods(periods: tuple[Period, ...]) -> str:
    degrees = [p.degree for p in periods]
    # Growth begins at zero.
    degrees += [0.0 for p in periods if p.growth]
    low, high = min(degrees), max(degrees)
    if periods[0].unit:
        ends = dict.fromkeys(f"{end:.3g}" for end in (low, high))
        return f"{' to '.join(ends)} {periods[0].unit}"
    if high - low < 0.005:
        return f"{100.0 * high:.1f} %"
    return f"{100.0 * low:.1f} to {100.0 * high:.1f} %"


def location_of(model: Model, finding: Finding, accepted: Sequence[Accepted] = ()) -> Location:
    """Where and when a finding shows; if it is ambiguous, also the places of its alternatives.

    A term without a name also has a shape.
    """
    candidate = _joined(model, finding.id)
    curve = next((own.curve for own in accepted if own.candidate.id == finding.id), None)
    title = model.ruleset.modules.get(finding.module, finding.module)
    term = model.term(candidate)
    if curve is not None:
        found = location_of_curve(model, curve, finding.closed, term)
        return replace(found, module=finding.module, place=finding.place, title=title)
    variables, where = model.variables(finding.module), (finding.module, finding.place, title)
    also: tuple[str, ...] = ()
    if finding.probability < limits.CERTAIN:
        place_of = {c.id: f"{c.module}.{c.place}" for c in model.builder.candidates}
        places = dict.fromkeys(place_of[a.id] for a in finding.alternatives if a.id in place_of)
        also = tuple(p for p in places if p != f"{finding.module}.{finding.place}")
    drivers = {d: variables[d] for d in candidate.drivers.values() if d in variables}
    found = location_at(model, where, finding.closed, term, also, drivers)
    periods = tuple((p.since, p.until) for p in finding.periods)
    return replace(found, region=(), periods=periods) if periods else found


def location_of_curve(
    model: Model, curve: CurveFound, share: float, size: Array | None = None
) -> Location:
    """A place whose error follows a driver in a way that has no name; `size`, shape (n,), is the
    mismatch by a term over time, by default that of the curve."""
    shape, driver = shape_of(model, curve), model.variable(curve.driver)
    if shape is not None and driver is not None:
        # Relative to its own level, as the fit to all points is centred.
        size = np.interp(driver.shown(driver.course), shape.at, shape.value) ** 2
    elif size is None:
        size = np.interp(model.samples.time, curve.at, curve.value) ** 2
    where = (curve.location.module, curve.location.place, curve.location.title)
    drivers = {} if driver is None else {curve.driver: driver}
    return replace(location_at(model, where, share, size, curve.elsewhere, drivers), shape=shape)


def location_at(
    model: Model,
    where: tuple[str, str, str],
    share: float,
    size: Array,
    also: tuple[str, ...],
    drivers: Mapping[str, Variable],
) -> Location:
    """A place by module, place and title; `also` are others that cannot be distinguished from it.

    `size`, shape (n,), is the mismatch there at each sample, not negative. The region is of a
    driver, else of any reading.
    """
    samples = model.samples
    return Location(
        module=where[0],
        place=where[1],
        title=where[2],
        share=share,
        region=region_of(size, drivers) or region_of(size, model.variables(where[0])),
        periods=periods_of(samples.time, size) if samples.timed else (),
        also=also,
    )


def untested(model: Model, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Ranges outside which a repaired law was not tested."""
    ranges: dict[str, None] = {}
    for finding in findings:
        if finding.sort not in ("physics", "ageing"):
            continue
        for name in _joined(model, finding.id).drivers.values():
            variable = model.variable(name)
            if variable is not None:
                low, high = variable.shown(np.nanquantile(variable.course, [0.0, 1.0]))
                ranges[f"{name} below {low:.4g} or above {high:.4g} {variable.unit}"] = None
    return tuple(ranges)


def of_recordings(recording: Recording, rows: Rows, found: ByRecording) -> tuple[OfRecording, ...]:
    """Each recording in the order given, with its rows and its own verdict."""
    source = recording.source
    assert source is not None
    data = rows.system.data
    serves = np.zeros(len(data), dtype=bool)
    serves[rows.group_point] = True
    used = (data.sample >= 0) & serves[np.maximum(data.sample, 0)]
    return tuple(
        OfRecording(
            name=recording.sources[alone.number],
            rows=int((source == alone.number).sum()),
            used=int((used & (source == alone.number)).sum()),
            verdict=alone.verdict,
            alone=alone.likely,
        )
        for alone in found.alone
    )


def updates_of(names: Sequence[str], found: ByRecording) -> tuple[Update, ...]:
    """The change by each further recording."""
    return tuple(
        Update(names[number], update_sentence(names[number], moved), moved)
        for number, moved in found.moved.items()
    )


def update_sentence(name: str, moved: Sequence[Moved]) -> str:
    """The change by a further recording, in one sentence.

    >>> update_sentence("b.csv", [Moved("x", "slip", 0.5, 0.97), Moved("y", "play", 0.25, 0.02)])
    'With b.csv: slip 50\xa0% -> 97\xa0%; play 25\xa0% -> 2\xa0%'
    """
    shown = []
    for one in moved[:MOVED]:
        before = "" if one.before is None else f"{percent(one.before)} -> "
        shown.append(f"{one.title} {before}{percent(one.after)}")
    return f"With {name}: {'; '.join(shown)}"
