"""The findings of a diagnosis for a page: first what is wrong, then the evidence."""

from collections.abc import Iterable, Iterator, Sequence

from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding, Period
from rulec_runtime.recordings.plant_calendar import Calendar, course, moment
from rulec_runtime.report.blindness import (
    PARTLY,
    not_judged,
    since_when,
    undetectable,
    unseen,
    why_and_how,
)
from rulec_runtime.report.document import badge
from rulec_runtime.report.growth import grown
from rulec_runtime.report.parts import Content, Facts, Part, Table, Words, html
from rulec_runtime.report.summary import summary
from rulec_runtime.report.text import Html, bounds, counted, degree, listed, percent, safe
from rulec_runtime.report.wording import (
    LISTED,
    NOT_ALL,
    actions,
    advice,
    causes,
    conditions,
    context,
    estimates,
    flow_unit,
    headline,
    readings_of,
    remarks_of,
    residual_rows,
    titled,
    treatment_of,
    why_first,
    worst_first,
)

REMARKS = 8
"""Most remarks shown."""

UNSEEN = "Not judged, or only in part"


def findings_parts(diagnosis: Diagnosis) -> Iterator[Part]:
    """Each fault with what to do about it."""
    calendar = diagnosis.calendar
    for sensor in diagnosis.sensors:
        when = course(calendar, sensor.since, sensor.until, sensor.behind)
        rows = {"When": when, "What to do": sensor.condition.action, "Note": treatment_of(sensor)}
        yield card(sensor.condition.status, sensor.text, rows.items())
    for found in diagnosis.regimes:
        regime, because = found.regime, conditions(found)
        when = course(calendar, found.since, found.until, found.behind)
        rows = {"When": when, "Because": because, "What to do": regime.action}
        yield card(regime.status, regime.text, rows.items())
    for finding in worst_first(diagnosis.findings):
        title = headline(diagnosis.ruleset, finding)
        yield card(finding.fault.status, title, _fault(diagnosis, finding))
    if len(diagnosis.findings) > 1:
        yield Part("", [summary(diagnosis, _named, "fault", others=True)])
    if diagnosis.blind:
        hints = [
            (since_when(b, calendar), f"{unseen(diagnosis.ruleset, b)}: {why_and_how(b)}")
            for b in diagnosis.blind[:LISTED]
        ]
        if (more := len(diagnosis.blind) - LISTED) > 0:
            hints.append(("", f"and {counted(more, 'other period')}"))
        yield card("C", f"{PARTLY}: {undetectable(diagnosis)}", hints)
    if (left := not_judged(diagnosis)) and not diagnosis.findings:
        yield Part(UNSEEN, [remarks(left, calendar)], "C")
    if diagnosis.unknown:
        sheet = all(p.from_sheet for p in diagnosis.unknown)
        title = "Deviations from the sheet" if sheet else "Deviations that nothing known explains"
        yield Part(title, [remarks(diagnosis.unknown, calendar)], "S")


def card(letter: str, title: str, rows: Iterable[tuple[str, str]], *below: Content) -> Part:
    """A finding with its letter of NE 107; rows without text are left out."""
    facts = Facts([(term, [text]) for term, text in rows if text])
    return Part(Html(f"{badge(letter, True)} {safe(title)}"), [facts, *below], letter)


def _fault(diagnosis: Diagnosis, finding: Finding) -> Iterator[tuple[str, str]]:
    fault, ruleset, calendar = finding.fault, diagnosis.ruleset, diagnosis.calendar
    when = course(calendar, finding.since, finding.until, finding.behind)
    same = [f for f in diagnosis.findings if f.fault.id == fault.id]
    if len(same) > 1:
        last = max(same, key=lambda f: f.until)
        whole = course(calendar, same[0].since, last.until, last.behind)
        when += f", the largest of {len(same)} findings {whole}"
    probability = f"{percent(finding.probability)} among the known faults"
    if diagnosis.mode == "paper":
        probability = "not said: paper mode names the fault with the largest degree and weighs no "
        probability += "other"
    elif finding.is_alone:
        probability += "; no other one fits"
    elif not (finding.alternatives or finding.remote):
        probability += f"; {NOT_ALL}"
    ends = bounds(finding.lower, finding.upper, fault.unit)
    yield "Degree", degree_of(degree(finding.degree, fault.unit), f"({ends}), {fault.meaning}")
    yield "Growth", grown(finding)
    yield "When", when
    yield "Probability", probability
    yield "What to do", actions(ruleset, finding)
    if finding.alternatives:
        faults = ruleset.fault_by_id
        others = [f"{titled(faults[name])} ({percent(p)})" for name, p in finding.alternatives]
        yield "Could also be", listed(others)
        for text in why_first(ruleset, finding):
            yield "Named first", text
        if finding.step is not None:
            yield "Next step", finding.step.text
        apart = "; ".join(advice(ruleset, finding))
        yield "To tell them apart", apart or "no single reading is known to do so"
    yield "Fits less well", causes(finding.remote)
    for text in context(ruleset, finding):
        yield "Note", text


def degree_of(size: str, more: str) -> Html:
    """A degree in large type, and what explains it."""
    return Html(f'<span class="degree">{safe(size)}</span> {safe(more)}')


def _named(fault: FaultSpec) -> tuple[Html]:
    return (Html(f"{badge(fault.status, True)} {safe(fault.id)}"),)


def evidence(diagnosis: Diagnosis) -> Iterator[Html]:
    """Per fault: residuals against their thresholds, and the estimates behind them."""
    for finding in worst_first(diagnosis.findings):
        since = moment(diagnosis.calendar, finding.since)
        until = moment(diagnosis.calendar, finding.until, finding.since)
        title = safe(f"{finding.fault.id} from {since} to {until}, where it shows most")
        yield ground_of(diagnosis.ruleset, finding, f"<h3>{title}</h3>")


def ground_of(ruleset: Ruleset, finding: Finding, heading: str = "") -> Html:
    """Residuals of a finding, and the estimates or readings behind them."""
    unit, left = flow_unit(ruleset), len(finding.evidence) - LISTED
    what, of = "estimates that should agree", f" [{unit.name}]"
    if ruleset.dynamics is not None:
        what, of = "readings that balances predict", ""
    titles = (what, f".differ by{of}", f".threshold{of}", ":fired", ":expected", "")
    parts: list[Content] = [Table(titles, residual_rows(ruleset, finding), what)]
    if left > 0:
        parts.append(Words(f"and {counted(left, 'other residual')}", soft=True))
    if finding.flows:
        flows = [
            (
                e.equation,
                f"{unit.factor * e.flow:.1f} ± {unit.factor * e.half:.1f}",
                ", ".join(e.readings),
            )
            for e in estimates(ruleset, finding)
        ]
        of_flows = ("estimate", f".flow [{unit.name}]", "from these readings")
        parts.append(Table(of_flows, flows, "estimates of flows"))
    else:
        read = readings_of(ruleset, finding)
        parts.append(Words(f"typical readings there: {read}", soft=True))
    body = "".join(map(html, parts))
    return Html(f'<div class="evidence">{heading}{body}</div>')


def remarks(periods: Sequence[Period], calendar: Calendar | None) -> Facts:
    """Remarks with the periods that they apply to."""
    found = remarks_of(periods, calendar)
    rows = [(spans, [text]) for text, spans in found[:REMARKS]]
    if len(found) > REMARKS:
        rows.append(("", [f"and {counted(len(found) - REMARKS, 'other remark')}"]))
    return Facts(rows, "remarks")
