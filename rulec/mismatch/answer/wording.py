"""Single values, periods, regions and curves in words and characters; the verdict as a symbol."""

from collections.abc import Iterator, Sequence

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.report.text import counted, degree, fixed, listed, moment, number, percent

from rulec.mismatch.result import UNDECIDED, Estimate, Finding, Mismatch, Period, Region, Shape
from rulec.mismatch.structure.hypotheses import CONNECTION

VERDICTS = {
    "none": ("ok", "no mismatch"),
    "named": ("M", "physics left out of the model"),
    "ambiguous": ("S", "a mismatch with several possible explanations"),
    "unnamed": ("S", "a mismatch that nothing known explains"),
    "unsure": ("S", "the model may be incomplete"),
    "fault": ("F", "a fault of the plant, not of the model"),
    "sensor": ("F", "an error of a sensor, not of the model"),
    "cannot judge": ("C", "cannot judge"),
}
"""Letter of NE 107 and meaning by verdict; verdicts with the same letter differ in words."""

SPANS = 4
"""Most periods listed one by one."""


def letter(mismatch: Mismatch) -> str:
    """The letter of NE 107."""
    return VERDICTS[mismatch.verdict][0]


def meaning(mismatch: Mismatch) -> str:
    """The verdict in words."""
    if mismatch.verdict == "named" and [f.name for f in mismatch.findings[:1]] == [CONNECTION]:
        return "The plant file and the readings disagree on what feeds what"
    words = VERDICTS[mismatch.verdict][1]
    return words[:1].upper() + words[1:]


def rounded(value: float, u: float, *more: float) -> tuple[str, ...]:
    """Numbers to two digits of a standard uncertainty, which comes last; a dash if there is none.

    >>> rounded(0.0231234, 0.00112)
    ('0.0231', '0.0011')
    """
    if not (np.isfinite(value) and np.isfinite(u) and u > 0):
        return (*(number(v, 4) for v in (value, *more)), "–")
    decimals = max(0, 1 - int(np.floor(np.log10(u))))
    return tuple(fixed(v, decimals) for v in (value, *more, u))


def suffix(unit: str) -> str:
    """A unit behind a number."""
    return "" if unit in ("", "1") else f" {unit}"


def quantity(value: float, u: float, unit: str) -> str:
    """A value in a sentence.

    >>> quantity(0.009404, 0.000216, "1/K"), quantity(0.2, 0.0, "1")
    ('0.00940 ± 0.00022 1/K', '0.2')
    """
    shown, spread = rounded(value, u)
    return (shown if spread == "–" else f"{shown} ± {spread}") + suffix(unit)


def interval(estimate: Estimate) -> str:
    """The 95 % interval of a parameter; a fixed one has none.

    >>> interval(Estimate("b", 0.02, 0.001, 0.018, 0.0221, "1/K"))
    '0.0180 to 0.0221'
    """
    low, high, _ = rounded(estimate.lower, estimate.u, estimate.upper)
    return f"{low} to {high}" if not estimate.u <= 0.0 else "fixed"


def region_words(region: Region) -> str:
    """The region of one variable.

    >>> region_words(Region("A.T", 52.0, None, "degC", 0.8))
    'A.T above 52 degC (80\\xa0% of it)'
    """
    low, high = (None if b is None else number(b, 4) for b in (region.low, region.high))
    words = f"at {low}" if region.low == region.high else f"from {low} to {high}"
    if low is None or high is None:
        words = f"below {high}" if low is None else f"above {low}"
    words += suffix(region.unit)
    if low is None and high is None:
        words = "anywhere"
    whole = f" ({share(region.share)} of it)" if np.isfinite(region.share) else ""
    return f"{region.variable} {words}{whole}"


def hysteresis(shape: Shape) -> str:
    """Whether it matters from which side the driver came, and why."""
    answer = "undecided" if shape.memory == UNDECIDED else shape.memory
    return f"{answer}: {shape.memory_text}"


def periods_words(periods: Sequence[tuple[float, float]]) -> str:
    """Periods in a sentence; of many the first ones."""
    spans = [f"{moment(a)} to {moment(b)}\u00a0s" for a, b in periods[:SPANS]]
    more = [counted(len(periods) - SPANS, "other period")] if len(periods) > SPANS else []
    return listed([*spans, *more])


def degree_words(periods: Sequence[Period]) -> Iterator[str]:
    """When a fault occurred, and its size; the largest ones in order of time."""
    largest = sorted(periods, key=lambda p: -abs(p.degree))[:SPANS]
    for p in sorted(largest, key=lambda p: p.since):
        span = f"{moment(p.since)} to {moment(p.until)}\u00a0s"
        size = f"{degree(p.degree, p.unit)} ± {degree(p.u, p.unit)}"
        yield growth_words(p) if p.growth else f"{span}: degree {size}"
    if len(periods) > SPANS:
        yield f"and {counted(len(periods) - SPANS, 'other period')}, none larger"


def growth_words(period: Period) -> str:
    """The onset, the degree reached and the rate.

    >>> from rulec.mismatch.result import Growth
    >>> growth = Growth(rate=0.03, u=0.001, lower=0.028, upper=0.032, u_since=60.0)
    >>> growth_words(Period(0.0, 18000.0, 0.15, 0.004, growth=growth))
    'grows since 0\xa0s, from 0 to 0.150 ± 0.004 at 18\u202f000\xa0s (0.0300 ± 0.0010 per hour)'
    """
    growth, unit = period.growth, f" {period.unit}" if period.unit else ""
    assert growth is not None
    rate, u = rounded(growth.rate, growth.u)
    size = f"{degree(period.degree, period.unit)} ± {degree(period.u, period.unit)}"
    until = f"{moment(period.until)}\u00a0s"
    return f"grows since {onset(period)}, from 0 to {size} at {until} ({rate} ± {u}{unit} per hour)"


def onset(period: Period) -> str:
    """When growth began, rounded to the first digit of its uncertainty."""
    growth = period.growth
    u = growth.u_since if growth is not None else 0.0
    digits = -int(np.floor(np.log10(u))) if u > 0 else 3
    return f"{moment(round(period.since, digits))}\u00a0s"


def titled(finding: Finding) -> str:
    """A finding and its module, once, as two may differ in the module alone."""
    if f"{finding.module}." in finding.title:
        return finding.title
    return f"{finding.title} in {', '.join(finding.members) or finding.module}"


def share(value: float) -> str:
    """A share in percent, which may be negative or unknown.

    >>> share(0.64), share(-0.02), share(float("nan"))
    ('64\xa0%', '−2\xa0%', '–')
    """
    if not np.isfinite(value):
        return "–"
    return percent(value) if value >= 0 else f"−{percent(-value)}"


def is_repaired(mismatch: Mismatch) -> bool:
    """Is there a repaired plant to write, beyond recalibrated values?"""
    return bool(mismatch.repair.joined)


CURVE, BAND = "•", "░"

ACROSS, DOWN = 44, 7
"""Characters of a plot."""


def text_plot(at: Array, value: Array, u: Array, units: tuple[str, str]) -> list[str]:
    """A curve over a driver with two standard uncertainties on either side; all of shape (n,).

    `units` are those of the driver and of the value.

    >>> z = np.linspace(0.0, 1.0, 5)
    >>> for row in text_plot(z, z, 0.0 * z, ("degC", "bar"))[::3]: print(row)
    1 bar ┤                                        ••••
          │                  ••••••••
        0 ┤••••
    """
    z = np.linspace(float(at[0]), float(at[-1]), ACROSS)
    middle, spread = np.interp(z, at, value), 2.0 * np.interp(z, at, u)
    low, high = float(np.min(middle - spread)), float(np.max(middle + spread))
    if not np.isfinite([low, high]).all() or high <= low:
        return []

    def row(values: Array) -> Array:
        return np.rint((high - values) / (high - low) * (DOWN - 1)).astype(int)

    cells = np.full((DOWN, ACROSS), " ")
    for i, (top, foot) in enumerate(zip(row(middle + spread), row(middle - spread), strict=True)):
        cells[top : foot + 1, i] = BAND
    cells[row(middle), np.arange(ACROSS)] = CURVE
    labels = [""] * DOWN
    labels[-1] = number(low)
    if low < 0.0 < high:
        labels[int(row(np.zeros(1))[0])] = "0"
    labels[0] = number(high) + suffix(units[1])
    width = max(map(len, labels))
    rows = [
        f"{label:>{width}} {'┤' if label else '│'}{''.join(line).rstrip()}"
        for label, line in zip(labels, cells, strict=True)
    ]
    first, last = number(float(at[0])), number(float(at[-1])) + suffix(units[0])
    rows.append(f"{'':>{width}}  {first}{last:>{ACROSS - len(first)}}")
    return rows
