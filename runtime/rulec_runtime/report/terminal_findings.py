"""Print a diagnosis on the terminal: findings first, then the evidence, then numbers."""

import numpy as np
from rich.console import Console
from rich.text import Text
from rich.tree import Tree

from rulec_runtime.contract.degree import degree_in_figures
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding, Period
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.plant_calendar import course
from rulec_runtime.report.blindness import PARTLY, blindness, not_judged, undetectable
from rulec_runtime.report.growth import grown
from rulec_runtime.report.parts import Table, shown
from rulec_runtime.report.sparkline import sparkline
from rulec_runtime.report.summary import summary
from rulec_runtime.report.text import percent
from rulec_runtime.report.wording import (
    COLOURS,
    LISTED,
    NOT_ALL,
    SHOWN,
    STATUS,
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
    rounded,
    status_in_words,
    treatment_of,
    why_first,
    worst_first,
)


def explain(out: Console, diagnosis: Diagnosis) -> None:
    """Print the whole diagnosis."""
    symbol, meaning = STATUS[diagnosis.status]
    colour = COLOURS[diagnosis.status]
    share = 100 * diagnosis.judged / max(diagnosis.samples, 1)
    verdict = status_in_words(symbol, diagnosis.status, meaning)
    out.print(styled("\n[bold {}]{}[/]  {}", colour, verdict, diagnosis.ruleset.title))
    settled = "" if diagnosis.ruleset.dynamics is not None else "settled and "
    judged = (
        f"{plural(diagnosis.samples, 'sample', 'samples')}, {share:.0f} % of them {settled}judged"
    )
    mode = "" if diagnosis.mode == "default" else f", mode {diagnosis.mode}"
    out.print(styled("[dim]{}{}[/]", judged, mode))
    for sensor in diagnosis.sensors:
        when = course(diagnosis.calendar, sensor.since, sensor.until, sensor.behind)
        tree = _titled(sensor.condition.status, sensor.id, sensor.text)
        tree.add(f"do: {sensor.condition.action}")
        tree.add(f"{when}; {treatment_of(sensor)}")
        out.print(tree)
    for found in diagnosis.regimes[:SHOWN]:
        regime = found.regime
        tree = _titled(regime.status, regime.id, regime.text)
        tree.add(f"do: {regime.action}")
        tree.add(f"because {conditions(found)}")
        tree.add(course(diagnosis.calendar, found.since, found.until, found.behind))
        tree.add(styled("[dim]{}[/]", regime.origin))
        out.print(tree)
    _more(out, len(diagnosis.regimes[SHOWN:]), "other regime")
    if diagnosis.findings:
        out.print(shown(summary(diagnosis, _named, "", "fault")))
    for finding in worst_first(diagnosis.findings):
        out.print(explanation(diagnosis, finding))
    if diagnosis.blind:
        tree = _titled("C", PARTLY, undetectable(diagnosis))
        for blind in diagnosis.blind[:LISTED]:
            tree.add(blindness(diagnosis.ruleset, blind, diagnosis.calendar))
        if (more := len(diagnosis.blind) - LISTED) > 0:
            tree.add(styled("[dim]and {} other periods (--json has all)[/]", more))
        out.print(tree)
    _periods(out, diagnosis, "Unknown", "yellow", diagnosis.unknown)
    _periods(out, diagnosis, "Not judged", "dim", not_judged(diagnosis))
    for note in diagnosis.notes[:SHOWN]:
        out.print(styled("[dim]note: {}[/]", note))
    _more(out, len(diagnosis.notes[SHOWN:]), "other note")


def _more(out: Console, count: int, what: str) -> None:
    if count:
        out.print(styled("[dim]and {} (--json has all)[/]", plural(count, what, f"{what}s")))


def _named(fault: FaultSpec) -> tuple[Text, Text]:
    symbol, colour = STATUS[fault.status][0], COLOURS[fault.status]
    return styled("[{}]{} {}[/]", colour, symbol, fault.status), styled("[bold]{}[/]", fault.id)


def _titled(letter: str, name: str, text: str) -> Tree:
    head = "\n[bold {}]{} {}[/] [bold]{}[/]  {}"
    words = COLOURS[letter], STATUS[letter][0], letter, name, text
    return Tree(styled(head, *words), guide_style="dim")


def explanation(diagnosis: Diagnosis, finding: Finding, period: str = "") -> Tree:
    """Finding, action, residuals, estimates, readings, rules, alternatives, sources.

    `period` says when, for a recording that has not ended.
    """
    ruleset = diagnosis.ruleset
    symbol, colour = STATUS[finding.fault.status][0], COLOURS[finding.fault.status]
    title = styled("\n[bold {}]{} {}[/]", colour, symbol, headline(ruleset, finding))
    tree = Tree(title, guide_style="dim")
    degree, *ends = (
        degree_in_figures(finding.fault, x) for x in (finding.degree, finding.lower, finding.upper)
    )
    when = period or course(diagnosis.calendar, finding.since, finding.until, finding.behind)
    about = f"{finding.fault.meaning}; seen {when}"
    tree.add(styled("degree [bold]{}[/] ({}, 95 %): {}", degree, " to ".join(ends), about))
    if finding.growth is not None and (words := grown(finding)):
        time, degrees, _ = np.array(finding.growth.path).T
        tree.add(styled("[bold]{}[/] {}", sparkline(time, np.maximum(degrees, 0.0)), words))
    tree.add(f"do: {actions(ruleset, finding)}")
    if finding.step is not None:
        tree.add(f"to tell them apart: {finding.step.text}")
    unit = flow_unit(ruleset)
    because = f"of these differences between estimates of the same flow ({unit.name})"
    rows = "estimates and the readings behind them"
    if ruleset.dynamics is not None:
        because = "these readings are not what the balances predict"
        rows = f"typical readings there: {readings_of(ruleset, finding)}"
    why = tree.add(f"because {because}")
    titles = ("residual", ".value", ".threshold", "fired", "expected", "")
    # On a narrow terminal only the words in the last column wrap.
    why.add(shown(Table(titles, residual_rows(ruleset, finding), broken=("",))))
    flows = why.add(rows)
    for e in estimates(ruleset, finding):
        value, half = rounded(unit.factor * e.flow, unit.factor * e.half)
        line = "{} = [bold]{}[/] ±{} {}  [dim]{}[/]"
        flows.add(styled(line, e.equation, value, half, unit.name, ", ".join(e.readings)))
    for text in context(ruleset, finding):
        why.add(text)
    _alternatives(diagnosis, finding, tree)
    # An unlisted error of a reading has no rule.
    equations = [c.equation for c in ruleset.cells_of_fault[finding.fault.id] if c.equation]
    rules = tree.add("rules and sources" if equations else "source")
    for text in (*equations[:SHOWN], finding.fault.origin):
        rules.add(styled("[dim]{}[/]", text))
    if finding.fault.frequency_origin:
        often = f"{finding.fault.frequency}: {finding.fault.frequency_origin}"
        rules.add(styled("[dim]{}[/]", often))
    return tree


def _alternatives(diagnosis: Diagnosis, finding: Finding, tree: Tree) -> None:
    probability = f"probability {percent(finding.probability)}"
    if finding.alternatives:
        also = causes(finding.alternatives)
        branch = tree.add(styled("{}; [yellow]also possible:[/] {}", probability, also))
        ruleset = diagnosis.ruleset
        for text in (*why_first(ruleset, finding), *advice(ruleset, finding)):
            branch.add(text)
    elif diagnosis.mode == "paper":
        tree.add("paper mode names the fault with the largest degree and weighs no other")
    elif finding.is_alone:
        tree.add(f"no other known fault fits; {probability}")
    else:
        tree.add(probability if finding.remote else f"{probability}; {NOT_ALL}")
    if finding.remote:
        tree.add(f"fits less well: {causes(finding.remote)}")


def _periods(
    out: Console, diagnosis: Diagnosis, title: str, style: str, periods: tuple[Period, ...]
) -> None:
    if not periods:
        return
    found = remarks_of(periods, diagnosis.calendar)
    out.print(styled("\n[bold {}]{}[/]", style, title))
    for text, spans in found[:SHOWN]:
        out.print(styled("[{}]  {}: {}[/]", style, spans, text))
    if len(found) > SHOWN:
        out.print(styled("[dim]  and {} other remarks (--json has all)[/]", len(found) - SHOWN))
