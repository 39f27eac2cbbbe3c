"""Write the findings of a diagnosis as HTML: first what is wrong, then the evidence."""

from collections.abc import Iterable, Iterator, Sequence

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.conditions import SensorFinding
from rulec_runtime.diagnosis.steady.findings import Finding, Period
from rulec_runtime.diagnosis.steady.regimes import RegimeFinding
from rulec_runtime.recordings.plant_calendar import Calendar, course, moment
from rulec_runtime.report.blindness import (
    PARTLY,
    hidden,
    since_when,
    told_else,
    unseen,
    why_and_how,
)
from rulec_runtime.report.growth import grown
from rulec_runtime.report.tables import Cell, Column, columns, table
from rulec_runtime.report.text import bounds, counted, degree, listed, percent, safe
from rulec_runtime.report.wording import (
    L_PER_H,
    LISTED,
    STATUS,
    actions,
    advice,
    agreement,
    causes,
    conditions,
    context,
    estimates,
    evidence_first,
    headline,
    kept_of,
    readings_of,
    remarks_of,
    rows_of,
    titled,
    told_residual,
    why_first,
    worst_first,
)

REMARKS = 8
"""Most remarks shown."""

UNSEEN = "Not judged, or only in part"


def badge(letter: str, small: bool = False) -> str:
    """Symbol and letter of NE 107."""
    style = "badge small" if small else "badge"
    return f'<span class="{style} is-{letter}">{STATUS[letter][0]} {letter}</span>'


def told(diagnosis: Diagnosis) -> str:
    """Each fault with what to do about it."""
    calendar, parts = diagnosis.calendar, list[str]()

    def when(found: SensorFinding | RegimeFinding) -> tuple[str, str]:
        return "When", safe(course(calendar, found.since, found.until, found.behind))

    for sensor in diagnosis.sensors:
        condition = sensor.condition
        rows = [("What to do", safe(condition.action)), ("Note", safe(kept_of(sensor)))]
        parts.append(finding_card(condition.status, safe(sensor.text), [when(sensor), *rows]))
    for found in diagnosis.regimes:
        regime = found.regime
        rows = [("Because", safe(conditions(found))), ("What to do", safe(regime.action))]
        parts.append(finding_card(regime.status, safe(regime.text), [when(found), *rows]))
    parts += [_fault(diagnosis, finding) for finding in worst_first(diagnosis.findings)]
    if len(diagnosis.findings) > 1:
        parts.append(_summary(diagnosis))
    if diagnosis.blind:
        rows = []
        for b in diagnosis.blind[:LISTED]:
            text = f"{unseen(diagnosis.ruleset, b)}: {why_and_how(b)}"
            rows.append((since_when(b, calendar), safe(text)))
        if (more := len(diagnosis.blind) - LISTED) > 0:
            rows.append(("", f"and {counted(more, 'other period')}"))
        parts.append(finding_card("C", f"{PARTLY}: {hidden(diagnosis)}", rows))
    remarked = []
    if (left := told_else(diagnosis)) and not diagnosis.findings:
        remarked.append(("C", UNSEEN, left))
    if diagnosis.unknown:
        sheet = all(p.from_sheet for p in diagnosis.unknown)
        title = "Deviations from the sheet" if sheet else "Deviations that nothing known explains"
        remarked.append(("S", title, diagnosis.unknown))
    for letter, title, periods in remarked:
        head = f'<div class="finding is-{letter}"><h3>{title}</h3>'
        parts.append(f"{head}{remarks(periods, calendar)}</div>")
    return "".join(parts)


def finding_card(letter: str, title: str, rows: Iterable[tuple[str, str]], below: str = "") -> str:
    """A finding with its NE 107 letter; `title`, texts of the rows and what is `below` are HTML,
    terms are not."""
    body = "".join(f"<dt>{safe(term)}</dt><dd>{text}</dd>" for term, text in rows)
    return (
        f'<section class="finding is-{letter}"><h3>{badge(letter, True)} {title}</h3>'
        f"<dl>{body}</dl>{below}</section>"
    )


def _fault(diagnosis: Diagnosis, finding: Finding) -> str:
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
    elif not (finding.alternatives or finding.remote):
        probability += "; no other one fits"
    rows = [
        (
            "Degree",
            f'<span class="degree">{safe(degree(finding.degree, fault.unit))}</span> '
            f"({safe(bounds(finding.lower, finding.upper, fault.unit))}), {safe(fault.meaning)}",
        ),
        *([("Growth", safe(words))] if (words := grown(finding)) else []),
        ("When", safe(when)),
        ("Probability", safe(probability)),
        ("What to do", safe(actions(ruleset, finding))),
    ]
    if finding.alternatives:
        faults = ruleset.fault_by_id
        others = [f"{titled(faults[name])} ({percent(p)})" for name, p in finding.alternatives]
        rows.append(("Could also be", safe(listed(others))))
        rows += [("Named first", safe(text)) for text in why_first(ruleset, finding)]
        apart = "; ".join(advice(ruleset, finding))
        if finding.step is not None:
            rows.append(("Next step", safe(finding.step.text)))
        rows.append(("To tell them apart", safe(apart or "no single reading is known to do so")))
    if finding.remote:
        rows.append(("Fits less well", safe(causes(finding.remote))))
    rows += [("Note", safe(text)) for text in context(ruleset, finding)]
    return finding_card(fault.status, safe(headline(ruleset, finding)), rows)


def _summary(diagnosis: Diagnosis) -> str:
    found = rows_of(diagnosis.findings, diagnosis.calendar)
    others = any(row.others for row in found)
    of = columns("fault", ".degree", ".95 % bounds", ".when", ".probability")
    of += [Column("could also be")] if others else []
    rows = []
    for row in found:
        unit, low = row.fault.unit, row.degrees[0]
        size = degree(low, unit) if row.alike else _between(unit, *row.degrees)
        probability = percent(row.probability) if diagnosis.mode != "paper" else "–"
        cells = [size, _between(unit, *row.bounds), row.when, probability]
        cells += [listed(row.others)] if others else []
        name = f"{badge(row.fault.status, True)} {safe(row.fault.id)}"
        rows.append([name, *map(safe, cells)])
    return table("all findings", of, rows)


def _between(unit: str, low: float, high: float) -> str:
    return f"{degree(low, unit)}–{degree(high, unit)}"


def evidence(diagnosis: Diagnosis) -> Iterator[str]:
    """Per fault: residuals against their thresholds, and the estimates behind them."""
    for finding in worst_first(diagnosis.findings):
        since = moment(diagnosis.calendar, finding.since)
        until = moment(diagnosis.calendar, finding.until, finding.since)
        title = safe(f"{finding.fault.id} from {since} to {until}, where it shows most")
        yield f'<div class="evidence"><h3>{title}</h3>{ground_of(diagnosis.ruleset, finding)}</div>'


def ground_of(ruleset: Ruleset, finding: Finding) -> str:
    """Residuals of a finding, and the estimates or readings behind them."""
    ordered = evidence_first(finding)
    left = len(ordered) - LISTED
    more = f'<p class="soft">and {counted(left, "other residual")}</p>' if left > 0 else ""
    what, unit = "estimates that should agree", " [l/h]"
    if ruleset.dynamics is not None:
        what, unit = "readings that balances predict", ""
    of = [
        *columns(what, f".differ by{unit}", f".threshold{unit}"),
        *(Column("fired", "mid"), Column("expected", "mid"), Column("")),
    ]
    rows: list[list[Cell | str]] = []
    for e in ordered[:LISTED]:
        kind, words = agreement(ruleset, finding, e)
        value, threshold = told_residual(ruleset, e, L_PER_H)
        value, fired, expected = (s.replace("-", "−") for s in (value, e.verdict, e.expected))
        first = map(safe, (e.residual, value, threshold, fired, expected))
        rows.append([*first, Cell(safe(words), kind)])
    residuals = table(what, of, rows) + more
    if not finding.flows:
        read = safe(readings_of(ruleset, finding))
        return f'{residuals}<p class="soft">typical readings there: {read}</p>'
    flows = (
        (
            safe(e.equation),
            f"{L_PER_H.factor * e.flow:.1f} ± {L_PER_H.factor * e.half:.1f}",
            safe(", ".join(e.readings)),
        )
        for e in estimates(ruleset, finding)
    )
    of = columns("estimate", ".flow [l/h]", "from these readings")
    return residuals + table("estimates of flows", of, flows)


def remarks(periods: Sequence[Period], calendar: Calendar | None) -> str:
    """Remarks with the periods that they apply to."""
    found = remarks_of(periods, calendar)
    rows = [f"<dt>{safe(spans)}</dt><dd>{safe(text)}</dd>" for text, spans in found[:REMARKS]]
    if len(found) > REMARKS:
        rows.append(f"<dt></dt><dd>and {counted(len(found) - REMARKS, 'other remark')}</dd>")
    return f'<dl class="remarks">{"".join(rows)}</dl>'
