"""A diagnosis as a story for the terminal: the finding first, then the evidence, then numbers."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.tree import Tree

from runtime.diagnose import Diagnosis
from runtime.findings import Evidence, Finding, Period
from runtime.ruleset import FaultSpec, Ruleset

_STATUS = {
    "F": ("✖", "red", "failure"),
    "C": ("▼", "dark_orange", "check function: too little could be judged"),
    "S": ("▲", "yellow", "out of specification"),
    "M": ("◆", "blue", "maintenance required"),
    "ok": ("✓", "green", "nothing found"),
}
_AGREES = {True: "[green]✓ agrees[/]", False: "[red]✗ contradicts[/]"}
SHOWN = 5
LISTED = 12
EITHER = 0.2
"""Alternatives more probable than this stand in the headline."""


def explain(out: Console, diagnosis: Diagnosis) -> None:
    """Print the whole story."""
    symbol, colour, meaning = _STATUS[diagnosis.status]
    share = 100 * diagnosis.judged / max(diagnosis.samples, 1)
    out.print(
        f"\n[bold {colour}]{symbol} {diagnosis.status} {meaning}[/]  "
        f"{escape(diagnosis.ruleset.title)}"
    )
    out.print(
        f"[dim]{diagnosis.samples} samples, {share:.0f} % of them settled and judged, "
        f"mode {diagnosis.mode}[/]"
    )
    _summary(out, diagnosis)
    for finding in _worst_first(diagnosis):
        out.print(_tree(diagnosis, finding))
    _periods(out, "Unknown", "yellow", diagnosis.unknown)
    _periods(out, "Not judged", "dim", diagnosis.not_judged)
    for note in diagnosis.notes[:SHOWN]:
        out.print(f"[dim]note: {escape(note)}[/]")


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
            _row(table, [finding])
    else:
        for members in sorted(groups.values(), key=len, reverse=True):
            _row(table, members)
    out.print(table)


def _row(table: Table, findings: list[Finding]) -> None:
    first = findings[0]
    symbol, colour, _ = _STATUS[first.fault.status]
    low, high = min(f.degree for f in findings), max(f.degree for f in findings)
    degree = f"{low:.3f}" if high - low < 5e-4 else f"{low:.3f}-{high:.3f}"
    bounds = f"{min(f.lower for f in findings):.3f}-{max(f.upper for f in findings):.3f}"
    when = f"{first.since:g}-{max(f.until for f in findings):g} s"
    if len(findings) > 1:
        when = f"{len(findings)} times, {when}"
    sure = sum(f.probability for f in findings) / len(findings)
    table.add_row(
        f"[{colour}]{symbol} {first.fault.status}[/]",
        f"[bold]{first.fault.id}[/]",
        degree,
        bounds,
        when,
        f"{100 * sure:.0f} %",
    )


def _worst_first(diagnosis: Diagnosis) -> list[Finding]:
    """The largest finding of each fault, at most five: enough to see why."""
    largest: dict[str, Finding] = {}
    for finding in diagnosis.findings:
        known = largest.get(finding.fault.id)
        if known is None or finding.degree > known.degree:
            largest[finding.fault.id] = finding
    return sorted(largest.values(), key=lambda f: -f.degree)[:SHOWN]


def _tree(diagnosis: Diagnosis, finding: Finding) -> Tree:
    """Finding, what to do, residuals, estimates, readings, rules, doubt, sources."""
    ruleset = diagnosis.ruleset
    symbol, colour, _ = _STATUS[finding.fault.status]
    headline = f"{symbol} {escape(finding.text)}"
    for name, probability in finding.alternatives:
        if probability > EITHER:
            other = ruleset.fault_by_id[name]
            headline += f"; or {escape(_title(other))} ({100 * probability:.0f} %)"
    tree = Tree(f"\n[bold {colour}]{headline}[/]", guide_style="dim")
    tree.add(
        f"degree [bold]{finding.degree:.3f}[/] ({finding.lower:.3f} to {finding.upper:.3f}, 95 %): "
        f"{escape(finding.fault.meaning)}; seen from {finding.since:g} s to {finding.until:g} s"
    )
    tree.add(f"do: {escape(finding.fault.action)}")
    why = tree.add("because these estimates of the same flow disagree (l/h)")
    why.add(_residual_table(ruleset, finding))
    flows = why.add("estimates and the readings behind them")
    for line in _estimates(ruleset, finding):
        flows.add(line)
    _doubt(diagnosis, finding, tree)
    rules = tree.add("rules and sources")
    for cell in ruleset.cells_of_fault[finding.fault.id][:SHOWN]:
        rules.add(f"[dim]{escape(cell.equation)}[/]")
    rules.add(f"[dim]{escape(finding.fault.origin)}[/]")
    return tree


def _title(fault: FaultSpec) -> str:
    """A fault with its module, as a phrase."""
    if fault.module in fault.title.split(".")[0]:
        return fault.title
    return f"{fault.title.lower()} in {fault.module}"


def _residual_table(ruleset: Ruleset, finding: Finding) -> Table:
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    for title in ("residual", "value", "limit", "fired", "expected", ""):
        justify = "right" if title in ("value", "limit") else "left"
        table.add_column(title, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    ordered = sorted(finding.evidence, key=lambda e: (e.expected == "0", e.verdict == "0"))
    for e in ordered[:12]:
        table.add_row(
            e.residual,
            f"{_l_per_h(e.value):.1f}" if e.verdict != "invalid" else "-",
            f"±{_l_per_h(e.threshold):.1f}" if e.verdict != "invalid" else "-",
            e.verdict,
            e.expected,
            _agreement(ruleset, finding, e),
        )
    return table


def _agreement(ruleset: Ruleset, finding: Finding, evidence: Evidence) -> str:
    if evidence.verdict == "invalid":
        return "[dim]not available[/]"
    if evidence.verdict == evidence.expected:
        return _AGREES[True]
    cells = {c.residual: c for c in ruleset.cells_of_fault[finding.fault.id]}
    cell = cells.get(evidence.residual)
    if evidence.verdict == "0" and cell is not None and cell.detectable > finding.degree:
        return f"[dim]seen from {cell.detectable:.2g} on[/]"
    return _AGREES[False] if evidence.verdict != "0" else "[yellow]~ weaker than expected[/]"


def _l_per_h(flow: float) -> float:
    return flow * 3.6e6


def _estimates(ruleset: Ruleset, finding: Finding) -> Iterator[str]:
    readings = dict(finding.readings)
    near = {
        o for c in ruleset.cells_of_fault[finding.fault.id] for o in _observers(ruleset, c.residual)
    }
    for name, flow, u in finding.flows:
        if name not in near:
            continue
        spec = ruleset.observer_by_id[name]
        parts = []
        for signal_id in spec.signals:
            signal = ruleset.signal_by_id[signal_id]
            if signal_id in readings:
                shown = (readings[signal_id] - signal.offset) / signal.factor
                parts.append(f"{signal_id} {shown:.4g} {signal.unit}")
        yield (
            f"{escape(spec.equation)} = [bold]{_l_per_h(flow):.1f}[/] ±{2 * _l_per_h(u):.1f} l/h  "
            f"[dim]{escape(', '.join(parts))}[/]"
        )


def _observers(ruleset: Ruleset, residual: str) -> list[str]:
    for spec in ruleset.residuals:
        if spec.id == residual:
            return [t.observer for t in spec.terms]
    return []


def _doubt(diagnosis: Diagnosis, finding: Finding, tree: Tree) -> None:
    """What else fits, and what would tell the causes apart."""
    if finding.alternatives:
        names = ", ".join(f"{name} ({100 * p:.0f} %)" for name, p in finding.alternatives[:SHOWN])
        doubt = tree.add(f"[yellow]also possible:[/] {names}")
        for text in _advice(diagnosis.ruleset, finding):
            doubt.add(escape(text))
    elif diagnosis.mode == "paper":
        tree.add("paper mode names the fault with the largest degree and weighs no other")
    else:
        tree.add(f"no other known fault fits; probability {100 * finding.probability:.0f} %")


def _advice(ruleset: Ruleset, finding: Finding) -> Iterator[str]:
    others = {name for name, _ in finding.alternatives}
    for group in ruleset.ambiguous:
        if finding.fault.id in group.faults and others & set(group.faults):
            yield f"{' / '.join(group.faults)}: {group.advice}"


def _periods(out: Console, title: str, style: str, periods: tuple[Period, ...]) -> None:
    if not periods:
        return
    kinds: dict[str, list[Period]] = {}
    for period in periods:
        kinds.setdefault(period.text, []).append(period)
    out.print(f"\n[bold {style}]{title}[/]")
    for text, members in list(kinds.items())[:SHOWN]:
        spans = ", ".join(f"{p.since:g}-{p.until:g} s" for p in members[:4])
        more = f" and {len(members) - 4} more" if len(members) > 4 else ""
        out.print(f"[{style}]  {spans}{more}: {escape(text)}[/]")
    if len(kinds) > SHOWN:
        out.print(f"[dim]  and {len(kinds) - SHOWN} other remarks (--json has all)[/]")
