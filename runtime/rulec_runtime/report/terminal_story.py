"""A diagnosis as a story for the terminal: the finding first, then the evidence, then numbers."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table
from rich.tree import Tree

from rulec_runtime.contract.degree import degree_in_figures
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.conditions import SensorFinding
from rulec_runtime.diagnosis.steady.findings import Finding, Period
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.when import course, span
from rulec_runtime.report.wording import (
    KEPT,
    LEFT_OUT,
    SHOWN,
    STATUS,
    actions,
    advice,
    agreement,
    causes,
    context,
    estimates,
    flow_unit,
    ground,
    headline,
    readings_of,
    told_residual,
    worst_first,
)

_COLOURS = {"F": "red", "C": "dark_orange", "S": "yellow", "M": "blue", "ok": "green"}
_AGREEMENT = {"agrees": "green", "contradicts": "red", "weaker": "yellow"}
LISTED = 12


def explain(out: Console, diagnosis: Diagnosis) -> None:
    """Print the whole story."""
    symbol, meaning = STATUS[diagnosis.status]
    colour = _COLOURS[diagnosis.status]
    share = 100 * diagnosis.judged / max(diagnosis.samples, 1)
    verdict = f"{symbol} {diagnosis.status} {meaning}"
    out.print(styled("\n[bold {}]{}[/]  {}", colour, verdict, diagnosis.ruleset.title))
    settled = "" if diagnosis.ruleset.dynamics is not None else "settled and "
    judged = f"{diagnosis.samples} samples, {share:.0f} % of them {settled}judged"
    out.print(styled("[dim]{}, mode {}[/]", judged, diagnosis.mode))
    for sensor in diagnosis.sensors:
        _sensor(out, diagnosis, sensor)
    _summary(out, diagnosis)
    for finding in worst_first(diagnosis.findings):
        out.print(_tree(diagnosis, finding))
    _periods(out, diagnosis, "Unknown", "yellow", diagnosis.unknown)
    _periods(out, diagnosis, "Not judged", "dim", diagnosis.not_judged)
    for note in diagnosis.notes[:SHOWN]:
        out.print(styled("[dim]note: {}[/]", note))


def _summary(out: Console, diagnosis: Diagnosis) -> None:
    """One line per finding; if there are many, one per fault."""
    if not diagnosis.findings:
        return
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    for title in ("", "fault", "degree", "95 % bounds", "when", "sure"):
        table.add_column(title, justify="right" if title == "sure" else "left", no_wrap=True)
    groups: dict[str, list[Finding]] = {}
    for finding in diagnosis.findings:
        groups.setdefault(finding.fault.id, []).append(finding)
    if len(diagnosis.findings) <= LISTED:
        for finding in diagnosis.findings:
            _row(table, diagnosis, [finding])
    else:
        for members in sorted(groups.values(), key=len, reverse=True):
            _row(table, diagnosis, members)
    out.print(table)


def _sensor(out: Console, diagnosis: Diagnosis, found: SensorFinding) -> None:
    """A reading that is none: what, since when, what to do."""
    letter = found.condition.status
    symbol, colour = STATUS[letter][0], _COLOURS[letter]
    when = course(diagnosis.calendar, found.since, found.until, found.behind)
    title = styled(
        "\n[bold {}]{} {}[/] [bold]{}[/]  {}", colour, symbol, letter, found.id, found.text
    )
    tree = Tree(title, guide_style="dim")
    tree.add(f"do: {found.condition.action}")
    tree.add(f"{when}; {LEFT_OUT if found.signal else KEPT}")
    out.print(tree)


def _row(table: Table, diagnosis: Diagnosis, findings: list[Finding]) -> None:
    first = findings[0]
    symbol, colour = STATUS[first.fault.status][0], _COLOURS[first.fault.status]
    low, high = min(f.degree for f in findings), max(f.degree for f in findings)
    alike = high - low < 5e-4 * first.fault.scale
    degree = degree_in_figures(first.fault, low, None if alike else high)
    lower, upper = min(f.lower for f in findings), max(f.upper for f in findings)
    bounds = degree_in_figures(first.fault, lower, upper)
    last = max(findings, key=lambda f: f.until)
    when = course(diagnosis.calendar, first.since, last.until, last.behind, short=True)
    if len(findings) > 1:
        when = f"{len(findings)} times, {when}"
    sure = sum(f.probability for f in findings) / len(findings)
    table.add_row(
        styled("[{}]{} {}[/]", colour, symbol, first.fault.status),
        styled("[bold]{}[/]", first.fault.id),
        degree,
        bounds,
        when,
        f"{100 * sure:.0f} %",
    )


def _tree(diagnosis: Diagnosis, finding: Finding) -> Tree:
    """Finding, what to do, residuals, estimates, readings, rules, doubt, sources."""
    ruleset = diagnosis.ruleset
    symbol, colour = STATUS[finding.fault.status][0], _COLOURS[finding.fault.status]
    title = styled("\n[bold {}]{} {}[/]", colour, symbol, headline(ruleset, finding))
    tree = Tree(title, guide_style="dim")
    degree, *ends = (
        degree_in_figures(finding.fault, x) for x in (finding.degree, finding.lower, finding.upper)
    )
    when = course(diagnosis.calendar, finding.since, finding.until, finding.behind)
    about = f"{finding.fault.meaning}; seen {when}"
    tree.add(styled("degree [bold]{}[/] ({}, 95 %): {}", degree, " to ".join(ends), about))
    tree.add(f"do: {actions(ruleset, finding)}")
    unit = flow_unit(ruleset)
    flow = "" if ruleset.dynamics is not None else f" ({unit.name})"
    why = tree.add(f"because {ground(ruleset)}{flow}")
    why.add(_residual_table(ruleset, finding))
    behind = list(estimates(ruleset, finding))
    rows = "estimates and the readings behind them"
    if ruleset.dynamics is not None:
        rows = f"typical readings there: {readings_of(ruleset, finding)}"
    flows = why.add(rows)
    for e in behind:
        value, half = f"{unit.factor * e.flow:.1f}", f"±{unit.factor * e.half:.1f} {unit.name}"
        told = "{} = [bold]{}[/] {}  [dim]{}[/]"
        flows.add(styled(told, e.equation, value, half, ", ".join(e.readings)))
    for text in context(ruleset, finding):
        why.add(text)
    _doubt(diagnosis, finding, tree)
    rules = tree.add("rules and sources" if ruleset.cells_of_fault[finding.fault.id] else "source")
    for cell in ruleset.cells_of_fault[finding.fault.id][:SHOWN]:
        rules.add(styled("[dim]{}[/]", cell.equation))
    rules.add(styled("[dim]{}[/]", finding.fault.origin))
    return tree


def _residual_table(ruleset: Ruleset, finding: Finding) -> Table:
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    for title in ("residual", "value", "limit", "fired", "expected", ""):
        justify = "right" if title in ("value", "limit") else "left"
        table.add_column(title, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    flow = flow_unit(ruleset)
    ordered = sorted(finding.evidence, key=lambda e: (e.expected == "0", e.verdict == "0"))
    for e in ordered[:12]:
        kind, words = agreement(ruleset, finding, e)
        row = told_residual(ruleset, e, flow)
        table.add_row(
            e.residual,
            row.value if e.verdict != "invalid" else "-",
            row.limit if e.verdict != "invalid" else "-",
            e.verdict,
            e.expected,
            styled("[{}]{}[/]", _AGREEMENT.get(kind, "dim"), words),
        )
    return table


def _doubt(diagnosis: Diagnosis, finding: Finding, tree: Tree) -> None:
    """What else fits, and what would tell the causes apart."""
    if finding.alternatives:
        doubt = tree.add(styled("[yellow]also possible:[/] {}", causes(finding.alternatives)))
        for text in advice(diagnosis.ruleset, finding):
            doubt.add(text)
    elif diagnosis.mode == "paper":
        tree.add("paper mode names the fault with the largest degree and weighs no other")
    elif not finding.remote:
        tree.add(f"no other known fault fits; probability {100 * finding.probability:.0f} %")
    if finding.remote:
        tree.add(f"less likely: {causes(finding.remote)}")


def _periods(
    out: Console, diagnosis: Diagnosis, title: str, style: str, periods: tuple[Period, ...]
) -> None:
    if not periods:
        return
    kinds: dict[str, list[Period]] = {}
    for period in periods:
        kinds.setdefault(period.text, []).append(period)
    out.print(styled("\n[bold {}]{}[/]", style, title))
    for text, members in list(kinds.items())[:SHOWN]:
        spans = ", ".join(span(diagnosis.calendar, p.since, p.until) for p in members[:4])
        more = f" and {len(members) - 4} more" if len(members) > 4 else ""
        out.print(styled("[{}]  {}{}: {}[/]", style, spans, more, text))
    if len(kinds) > SHOWN:
        out.print(styled("[dim]  and {} other remarks (--json has all)[/]", len(kinds) - SHOWN))
