"""Words that the terminal and the report share: one comparison, told the same way twice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.report.text import counted, degree, fixed, listed, moment, number, percent
from rulec_runtime.report.wording import STATUS

from rulec.mismatch import limits
from rulec.mismatch.result import (
    Alternative,
    Beaten,
    Confounded,
    Estimate,
    Evidence,
    Finding,
    Fit,
    HiddenDriver,
    Location,
    Mismatch,
    Period,
    Region,
    Shape,
)
from rulec.mismatch.structure.hypotheses import CONNECTION

VERDICTS = {
    "none": ("ok", "no mismatch"),
    "named": ("M", "physics left out of the model"),
    "ambiguous": ("S", "a mismatch; several explanations fit about as well"),
    "unnamed": ("S", "a mismatch that nothing known explains"),
    "unsure": ("S", "the model may be incomplete"),
    "fault": ("F", "a fault of the plant, not of the model"),
    "sensor": ("F", "an error of a sensor, not of the model"),
    "cannot judge": ("C", "cannot judge"),
}
"""Verdict to letter of NE 107 and meaning; two verdicts of one letter differ in words."""

MISCONNECTED = "The plant file says otherwise than the readings what feeds what"
"""Meaning of a verdict where that comes first."""

SORTS = {
    "physics": "physics that the model leaves out",
    "ageing": "a change with time or age",
    "fault": "a fault of the plant",
    "sensor": "an error of a sensor",
    "structure": "an error of the table, neither of the plant nor of a sensor",
    CONNECTION: "an error of the plant file, neither of the plant nor of a sensor",
    "free": "a dependence for which the catalogue has no name",
}

PACES = ((2 * 86400.0, "day", 24.0), (3600.0, "hour", 1.0), (0.0, "minute", 1.0 / 60.0))
"""From which length of a growth, s, its rate is told per which time, and how many hours that is."""

SPANS = 4
"""Periods named one by one."""


def letter(mismatch: Mismatch) -> str:
    """Letter of NE 107."""
    return VERDICTS.get(mismatch.verdict, ("C", ""))[0]


def symbol(mismatch: Mismatch) -> str:
    """Symbol of NE 107, by whose shape verdicts are told apart without colour."""
    return STATUS[letter(mismatch)][0]


def meaning(mismatch: Mismatch) -> str:
    """The verdict in words."""
    if mismatch.verdict == "named" and [f.name for f in mismatch.findings[:1]] == [CONNECTION]:
        return MISCONNECTED
    words = VERDICTS.get(mismatch.verdict, ("C", mismatch.verdict))[1]
    return words[:1].upper() + words[1:]


def of_recordings_words(mismatch: Mismatch) -> Iterator[tuple[str, str]]:
    """Each of several recordings with what it says alone, then what each further one changed."""
    for part in mismatch.recordings:
        said = VERDICTS.get(part.verdict, ("", part.verdict))[1]
        likely = "; ".join(f"{likely.title} {percent(likely.probability)}" for likely in part.alone)
        used = f"{part.used} of {counted(part.rows, 'row')} used"
        yield part.name, f"{used}; alone: {said}" + (f" ({likely})" if likely else "")
    for update in mismatch.changed:
        yield "changed", update.text


def value_and_u(estimate: Estimate) -> tuple[str, str]:
    """Value and standard uncertainty, both to two digits of the latter; a dash without one.

    >>> value_and_u(Estimate("b", 0.0231234, 0.00112, 0.021, 0.025, "1/K"))
    ('0.0231', '0.0011')
    """
    value, u = estimate.value, estimate.u
    if not (np.isfinite(value) and np.isfinite(u) and u > 0):
        return number(value, 4), "–"
    decimals = max(0, 1 - int(np.floor(np.log10(u))))
    return fixed(value, decimals), fixed(u, decimals)


def quantity(estimate: Estimate) -> str:
    """A parameter in a sentence.

    >>> quantity(Estimate("b", 0.009404, 0.000216, 0.009, 0.0098, "1/K"))
    '0.00940 ± 0.00022 1/K'
    """
    value, u = value_and_u(estimate)
    told = value if u == "–" else f"{value} ± {u}"
    return told if estimate.unit == "1" else f"{told} {estimate.unit}"


def interval(estimate: Estimate) -> str:
    """The 95 % interval of a parameter; one that was not searched for has none.

    >>> interval(Estimate("b", 0.02, 0.001, 0.018, 0.0221, "1/K"))
    '0.0180 to 0.0221'
    """
    low, high, u = estimate.lower, estimate.upper, estimate.u
    if not u > 0:
        return "fixed"
    decimals = max(0, 1 - int(np.floor(np.log10(u)))) if np.isfinite(u) else 3
    return f"{fixed(low, decimals)} to {fixed(high, decimals)}"


def where(location: Location) -> str:
    """A place with its name in the equations, and how much of the mismatch lies there."""
    name = f"{location.module}.{location.place}"
    place = name if location.title in ("", name) else f"{location.title} ({name})"
    if not np.isfinite(location.share):
        return place
    return f"{place}: {share(location.share)} of the mismatch"


def region_words(region: Region) -> str:
    """The region of one variable.

    >>> region_words(Region("A.T", 52.0, None, "degC", 0.8))
    'A.T above 52 degC (80\\xa0% of it)'
    """
    low, high = (None if b is None else number(b, 4) for b in (region.low, region.high))
    unit = "" if region.unit == "1" else f" {region.unit}"
    if low is None and high is None:
        words = f"{region.variable} anywhere"
    elif high is None:
        words = f"{region.variable} above {low}{unit}"
    elif low is None:
        words = f"{region.variable} below {high}{unit}"
    elif region.low == region.high:
        words = f"{region.variable} at {low}{unit}"
    else:
        words = f"{region.variable} from {low} to {high}{unit}"
    return words + (f" ({share(region.share)} of it)" if np.isfinite(region.share) else "")


def periods_words(periods: Sequence[tuple[float, float]]) -> str:
    """Periods in a sentence; of many the first ones."""
    spans = [f"{moment(a)} to {moment(b)}\u00a0s" for a, b in periods[:SPANS]]
    more = [counted(len(periods) - SPANS, "other period")] if len(periods) > SPANS else []
    return listed([*spans, *more])


def degree_words(periods: Sequence[Period]) -> Iterator[str]:
    """When a fault was there, and how large; the largest ones in order of time."""
    largest = sorted(periods, key=lambda p: -abs(p.degree))[:SPANS]
    for p in sorted(largest, key=lambda p: p.since):
        span = f"{moment(p.since)} to {moment(p.until)}\u00a0s"
        size = f"{degree(p.degree, p.unit)} ± {degree(p.u, p.unit)}"
        yield growth_words(p) if p.growth else f"{span}: degree {size}"
    if len(periods) > SPANS:
        yield f"and {counted(len(periods) - SPANS, 'other period')}, none larger"


def growth_words(period: Period) -> str:
    """Since when, from nothing to what, and how fast, in a time that is told well.

    >>> from rulec.mismatch.result import Growth
    >>> growth = Growth(rate=0.03, u=0.001, lower=0.028, upper=0.032, u_since=60.0)
    >>> growth_words(Period(0.0, 18000.0, 0.15, 0.004, growth=growth))
    'grows since 0\xa0s, from 0 to 0.150 ± 0.004 at 18\u202f000\xa0s (0.0300 ± 0.0010 per hour)'
    """
    growth, unit = period.growth, f" {period.unit}" if period.unit else ""
    assert growth is not None
    length = period.until - period.since
    per, hours = next((word, h) for least, word, h in PACES if length >= least)
    rate, u = value_and_u(
        Estimate("", growth.rate * hours, growth.u * hours, growth.lower, growth.upper, "")
    )
    size = f"{degree(period.degree, period.unit)} ± {degree(period.u, period.unit)}"
    until = f"{moment(period.until)}\u00a0s"
    return (
        f"grows since {onset(period)}, from 0 to {size} at {until} ({rate} ± {u}{unit} per {per})"
    )


def onset(period: Period) -> str:
    """When what grows began, to the first digit of its uncertainty."""
    growth = period.growth
    u = growth.u_since if growth is not None else 0.0
    digits = -int(np.floor(np.log10(u))) if u > 0 else 3
    return f"{moment(round(period.since, digits))}\u00a0s"


def finding_facts(finding: Finding, most: int | None = None) -> Iterator[tuple[str, str]]:
    """Terms and what is to be said of a finding; so many alternatives at `most`."""
    sort = SORTS.get(finding.name if finding.name == CONNECTION else finding.sort, finding.sort)
    yield "probability", f"{share(finding.probability)}, {sort}"
    others = [f"{a.title} ({share(a.probability)})" for a in plausible(finding)]
    if others:
        left = len(others[most:]) if most else 0
        more = f" and {counted(left, 'other')}" if left else ""
        yield "could also be", listed(others[:most]) + more
    for words in degree_words(finding.periods):
        yield "when", words
    if finding.action:
        yield "do", finding.action


def where_of(finding: Finding) -> str:
    """Its place in the equations, or the columns that it is about."""
    columns = finding.sort == "structure"
    return finding.place if columns else f"{finding.module}.{finding.place}"


def place_facts(location: Location, drawn: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """Terms and what is to be said of a place; `drawn` are rows with the shape of what is left
    out."""
    yield "where", where(location)
    if location.region:
        yield "", "; ".join(region_words(region) for region in location.region)
    if location.periods:
        yield "", periods_words(location.periods)
    if location.also:
        yield "", f"not told apart from {listed(location.also)}"
    if location.shape is not None:
        yield from shape_facts(location.shape, drawn)


def shape_facts(shape: Shape, drawn: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """Terms and what is to be said of the shape of what has no name."""
    yield "shape", f"over {shape.driver} {shape.text}"
    yield from (("", row) for row in drawn)
    yield "memory", f"{shape.memory}: {shape.memory_text}"
    for beaten in shape.beaten[: limits.LOST_TOLD]:
        yield "not", beaten_words(beaten)


def beaten_words(beaten: Beaten) -> str:
    """An effect that lost, by how much, and where.

    >>> beaten_words(Beaten("x", "Slip by temperature", 40.2, Region("T", 50.0, None, "degC", 0.8)))
    'Slip by temperature: fits worse by 40 in log likelihood, 80\xa0% of that at T above 50 degC'
    """
    words = f"{beaten.title}: fits worse by {number(beaten.nats, 2)} in log likelihood"
    if beaten.region is None:
        return words
    region = replace(beaten.region, share=float("nan"))
    return f"{words}, {share(beaten.region.share)} of that at {region_words(region)}"


def hidden_facts(hidden: HiddenDriver, drawn: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """Terms and what is to be said of a hidden driver; `drawn` are rows below its course."""
    yield "course", hidden.text
    yield from (("", row) for row in drawn)
    if hidden.candidates:
        yield "could be", listed(hidden.candidates)
    if hidden.sensor:
        yield "sensor", hidden.sensor


def errors_of(fit: Fit, repaired: bool) -> tuple[tuple[str, float, float], ...]:
    """Name and error of each model on estimation and held-out blocks, in the unit of the signal."""
    seen, kept = fit.estimation, fit.heldout
    rows = [
        ("as shipped", seen.shipped, kept.shipped),
        ("recalibrated", seen.recalibrated, kept.recalibrated),
        ("repaired", seen.repaired, kept.repaired),
        ("noise alone", seen.noise, kept.noise),
    ]
    return tuple(row for row in rows if repaired or row[0] != "repaired")


def other_fits(mismatch: Mismatch) -> tuple[Fit, ...]:
    """Predicted signals besides the one that the proof is about."""
    return tuple(fit for fit in mismatch.fits if fit != mismatch.fit)


def fit_words(fit: Fit, repaired: bool) -> str:
    """Held-out errors of one predicted signal in a row."""
    rows = errors_of(fit, repaired)
    unit = "" if fit.unit == "1" else f" {fit.unit}"
    return f"{fit.signal} " + ", ".join(f"{number(kept)} {name}" for name, _, kept in rows) + unit


def proof_title(mismatch: Mismatch) -> str:
    """What errors on held-out blocks are: no proof of what `rulec adopt` refuses."""
    return "Not proven" if mismatch.unproven else "Proof"


def proof(mismatch: Mismatch, fit: Fit) -> str:
    """What held-out blocks say of the repair, or of recalibration where there is none."""
    why = mismatch.unproven
    refused = f"Not proven: rulec adopt refuses, because {why}. " if why else ""
    return refused + _heldout_words(fit, is_repaired(mismatch))


def _heldout_words(fit: Fit, repaired: bool) -> str:
    kept = fit.heldout
    points = counted(kept.points, "held-out point")
    if not repaired:
        kept_out = counted(kept.points, "point")
        were = "was" if kept.points == 1 else "were"
        return f"{kept_out} {were} held out and played no part in the search."
    fall = 1 - kept.repaired / kept.recalibrated if kept.recalibrated > 0 else np.nan
    if not np.isfinite(fall):
        return f"The error on {points} could not be compared."
    low, high = fit.gain_interval
    way = "falls" if fall >= 0 else "rises"
    words = f"On {points} the error {way} by {share(abs(fall))} against recalibration"
    if np.isfinite(low) and np.isfinite(high):
        words += f" (95\u00a0%: {share(low)} to {share(high)})"
    if np.isfinite(fit.closed):
        words += f"; {share(fit.closed)} of the explainable mismatch is closed"
    return words + "."


MANY_REASONS = 3
"""Reasons why rows were not used that are told one by one."""


def evidence_rows(mismatch: Mismatch, most: int = MANY_REASONS) -> tuple[Evidence, ...]:
    """What rows served for and why others were not used; of either the most, the rest as one."""
    told: list[Evidence] = []
    for used, rest in ((True, "used in other ways"), (False, "not used for other reasons")):
        own = [e for e in mismatch.evidence if e.used is used]
        told += own if len(own) <= most + 1 else own[:most]
        if len(own) > most + 1:
            told.append(Evidence(sum(e.rows for e in own[most:]), used, f"{rest} (--json has all)"))
    return tuple(told)


def evidence_words(mismatch: Mismatch) -> str:
    """How many of the rows were used."""
    rows = sum(e.rows for e in mismatch.evidence)
    used = sum(e.rows for e in mismatch.evidence if e.used)
    return f"{used} of {counted(rows, 'row')} {'was' if rows == 1 else 'were'} used"


def explained_words(mismatch: Mismatch) -> str:
    """What the whole explanation reaches, where a model may not hold all of it; else empty."""
    fit, left = mismatch.fit, {name for name, _ in mismatch.left_out}
    if fit is None or not left or not np.isfinite(fit.heldout.explained):
        return ""
    titles = [titled(f) for f in mismatch.findings if f.id in left]
    what = f" ({listed(titles)})" if titles else ""
    unit = "" if fit.unit == "1" else f" {fit.unit}"
    return (
        "The errors above are those of the plant that `rulec adopt` would write. With what a plant "
        f"model cannot hold{what}, the error falls to {number(fit.heldout.explained)}{unit}."
    )


def titled(finding: Finding) -> str:
    """A finding and the module that it is about; two may differ by the module alone."""
    return f"{finding.title} in {', '.join(finding.members) or finding.module}"


def rivals_words(finding: Finding) -> str:
    """What the finding won against: its gain, and that of the strongest rival."""
    known = [r for r in finding.rivals if np.isfinite(r.gain)]
    title = "What has no name" if finding.sort == "free" else titled(finding)
    words = f"{title}: gain in log likelihood {number(finding.gain)}"
    if not known:
        return f"{words}."
    best = max(known, key=lambda r: r.gain)
    if finding.sort == "free":
        return f"{words}; the best name gains {number(best.gain)} ({best.title})."
    return (
        f"{words}; strongest of {counted(len(finding.rivals), 'rival')} {number(best.gain, 2)} "
        f"({best.title})."
    )


def share(value: float) -> str:
    """A share in percent, also a negative one or one that is not known.

    >>> share(0.64), share(-0.02), share(float("nan"))
    ('64\xa0%', '−2\xa0%', '–')
    """
    if not np.isfinite(value):
        return "–"
    return percent(value) if value >= 0 else f"−{percent(-value)}"


def plausible(finding: Finding) -> tuple[Alternative, ...]:
    """Alternatives worth a word, the most probable first."""
    ordered = sorted(finding.alternatives, key=lambda a: -a.probability)
    return tuple(a for a in ordered if a.probability >= limits.PLAUSIBLE)


def confounded_words(pair: Confounded) -> str:
    """Two parameters that the recording does not tell apart."""
    return f"{pair.first} and {pair.second} (correlation {number(pair.correlation, 2)})"


def is_repaired(mismatch: Mismatch) -> bool:
    """Is there a plant to write, with more than other values?"""
    return bool(mismatch.repair.joined)


def labelled(finding: Finding) -> Iterator[tuple[str, Estimate]]:
    """Parameters with module, title and the name that they have in the equation.

    Those of a curve without a name are told by its shape.
    """
    if finding.sort == "free":
        return
    for name, estimate in finding.parameters.items():
        title = f", {estimate.title}" if estimate.title else ""
        yield f"{finding.module}: {name}{title}", estimate
