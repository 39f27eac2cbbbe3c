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
    Row,
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
    parts = [_sensor(diagnosis, found) for found in diagnosis.sensors]
    parts += [_regime(diagnosis, found) for found in diagnosis.regimes]
    parts += [_fault(diagnosis, finding) for finding in worst_first(diagnosis.findings)]
    if len(diagnosis.findings) > 1:
        parts.append(_summary(diagnosis))
    if diagnosis.blind:
        parts.append(_blind(diagnosis))
    left = told_else(diagnosis)
    if left and not diagnosis.findings:
        parts.append(_remarked("C", UNSEEN, left, diagnosis.calendar))
    if diagnosis.unknown:
        sheet = all(p.from_sheet for p in diagnosis.unknown)
        title = "Deviations from the sheet" if sheet else "Deviations that nothing known explains"
        parts.append(_remarked("S", title, diagnosis.unknown, diagnosis.calendar))
    return "".join(parts)


def _remarked(letter: str, title: str, periods: Sequence[Period], calendar: Calendar | None) -> str:
    return f'<div class="finding is-{letter}"><h3>{title}</h3>{remarks(periods, calendar)}</div>'


def finding_card(letter: str, title: str, rows: Iterable[tuple[str, str]], below: str = "") -> str:
    """A finding with its NE 107 letter; `title`, texts of the rows and what is `below` are HTML,
    terms are not."""
    body = "".join(f"<dt>{safe(term)}</dt><dd>{text}</dd>" for term, text in rows)
    return (
        f'<section class="finding is-{letter}"><h3>{badge(letter, True)} {title}</h3>'
        f"<dl>{body}</dl>{below}</section>"
    )


def _sensor(diagnosis: Diagnosis, found: SensorFinding) -> str:
    rows = [
        ("When", safe(course(diagnosis.calendar, found.since, found.until, found.behind))),
        ("What to do", safe(found.condition.action)),
        ("Note", safe(kept_of(found))),
    ]
    return finding_card(found.condition.status, safe(found.text), rows)


def _regime(diagnosis: Diagnosis, found: RegimeFinding) -> str:
    regime = found.regime
    rows = [
        ("When", safe(course(diagnosis.calendar, found.since, found.until, found.behind))),
        ("Because", safe(conditions(found))),
        ("What to do", safe(regime.action)),
    ]
    return finding_card(regime.status, safe(regime.text), rows)


def _blind(diagnosis: Diagnosis) -> str:
    rows = []
    for b in diagnosis.blind[:LISTED]:
        text = f"{unseen(diagnosis.ruleset, b)}: {why_and_how(b)}"
        rows.append((since_when(b, diagnosis.calendar), safe(text)))
    if (more := len(diagnosis.blind) - LISTED) > 0:
        rows.append(("", f"and {counted(more, 'other period')}"))
    return finding_card("C", f"{PARTLY}: {hidden(diagnosis)}", rows)


def _fault(diagnosis: Diagnosis, finding: Finding) -> str:
    fault, ruleset = finding.fault, diagnosis.ruleset
    rows = [
        (
            "Degree",
            f'<span class="degree">{safe(degree(finding.degree, fault.unit))}</span> '
            f"({safe(bounds(finding.lower, finding.upper, fault.unit))}), {safe(fault.meaning)}",
        ),
        *([("Growth", safe(words))] if (words := grown(finding)) else []),
        ("When", safe(_when(diagnosis, finding))),
        ("Probability", safe(_probability(diagnosis, finding))),
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


def _when(diagnosis: Diagnosis, finding: Finding) -> str:
    """Period of a finding, and its place among others of the same fault."""
    same = [f for f in diagnosis.findings if f.fault.id == finding.fault.id]
    text = course(diagnosis.calendar, finding.since, finding.until, finding.behind)
    if len(same) == 1:
        return text
    last = max(same, key=lambda f: f.until)
    whole = course(diagnosis.calendar, same[0].since, last.until, last.behind)
    return f"{text}, the largest of {len(same)} findings {whole}"


def _probability(diagnosis: Diagnosis, finding: Finding) -> str:
    if diagnosis.mode == "paper":
        return "not said: paper mode names the fault with the largest degree and weighs no other"
    text = f"{percent(finding.probability)} among the known faults"
    return text if finding.alternatives or finding.remote else f"{text}; no other one fits"


def _summary(diagnosis: Diagnosis) -> str:
    rows = rows_of(diagnosis.findings, diagnosis.calendar)
    others = any(row.others for row in rows)
    of = columns("fault", ".degree", ".95 % bounds", ".when", ".probability")
    of += [Column("could also be")] if others else []
    weighed = diagnosis.mode != "paper"
    return table("all findings", of, (_summary_row(row, weighed, others) for row in rows))


def _summary_row(row: Row, weighed: bool, others: bool) -> list[Cell | str]:
    unit, low = row.fault.unit, row.degrees[0]
    found = degree(low, unit) if row.alike else _between(unit, *row.degrees)
    probability = percent(row.probability) if weighed else "–"
    cells = (found, _between(unit, *row.bounds), row.when, probability)
    more = [listed(row.others)] if others else []
    name = f"{badge(row.fault.status, True)} {safe(row.fault.id)}"
    return [name, *map(safe, (*cells, *more))]


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
    if finding.flows:
        return _residuals(ruleset, finding) + _estimates(ruleset, finding)
    read = safe(readings_of(ruleset, finding))
    return f'{_residuals(ruleset, finding)}<p class="soft">typical readings there: {read}</p>'


def _residuals(ruleset: Ruleset, finding: Finding) -> str:
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
    return table(what, of, rows) + more


def _estimates(ruleset: Ruleset, finding: Finding) -> str:
    rows = (
        (
            safe(e.equation),
            f"{L_PER_H.factor * e.flow:.1f} ± {L_PER_H.factor * e.half:.1f}",
            safe(", ".join(e.readings)),
        )
        for e in estimates(ruleset, finding)
    )
    of = columns("estimate", ".flow [l/h]", "from these readings")
    return table("estimates of flows", of, rows)


def remarks(periods: Sequence[Period], calendar: Calendar | None) -> str:
    """Remarks with the periods that they apply to."""
    found = remarks_of(periods, calendar)
    rows = [f"<dt>{safe(spans)}</dt><dd>{safe(text)}</dd>" for text, spans in found[:REMARKS]]
    if len(found) > REMARKS:
        rows.append(f"<dt></dt><dd>and {counted(len(found) - REMARKS, 'other remark')}</dd>")
    return f'<dl class="remarks">{"".join(rows)}</dl>'
