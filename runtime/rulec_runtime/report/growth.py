"""Describe a growing fault in words: its past, present and future degree."""

from rulec_runtime.contract.degree import degree_in_words
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.steady.growth import Growth
from rulec_runtime.recordings.plant_calendar import DAY, duration


def grown(finding: Finding) -> str:
    """How large a fault is, how fast it grows and where it leads; empty if it does not grow.

    A terminal shows these words beside its course so far.
    """
    growth = finding.growth
    if growth is None or growth.rate is None:
        return ""
    fault, (seconds, _) = finding.fault, growth.per
    each = "day" if seconds == DAY else "hour"
    low, high = (degree_in_words(fault, x) for x in (growth.lower, growth.upper))
    now = f"{degree_in_words(fault, growth.degree)} now ({low} to {high})"
    peak = max(degree for _, degree, _ in growth.path)
    if not growth.grows and peak > growth.upper:
        return f"{now}; it was {degree_in_words(fault, peak)} before"
    if growth.rate[1] <= 0.0 <= growth.rate[2]:
        return ""
    middle, *ends = (degree_in_words(fault, x * seconds) for x in growth.rate)
    way = "grows by" if growth.rate[0] > 0.0 else "changes by"
    rate = f"{way} {middle} per {each} ({' to '.join(ends)})"
    if not growth.grows and growth.next_degree is None:
        return ""
    if not growth.grows:
        rate = f"goes up in steps, by about {middle} per {each}"
    return "; ".join(filter(None, (now, rate, _ahead(fault, growth))))


def _ahead(fault: FaultSpec, growth: Growth) -> str:
    ahead = growth.next_degree
    if ahead is None:
        return ""
    level = degree_in_words(fault, ahead.degree)
    soon, late = (duration(max(t - growth.time, 0.0)) for t in (ahead.earliest, ahead.latest))
    if ahead.open_end:
        return f"reaches {level} in {soon} at the earliest"
    if not growth.grows:
        return f"the next step may reach {level}, within {late}"
    time = soon if soon == late else f"{soon} to {late}"
    return f"reaches {level} in {time} at this rate"
