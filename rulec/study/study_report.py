"""A study for the terminal, as a page, and as JSON data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.document import Head, document, facts, section
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.tables import columns, table
from rulec_runtime.report.text import safe

from rulec.study.campaign import Settings
from rulec.study.points import Points
from rulec.study.sensors_needed import show_without, without_each
from rulec.study.summary import LEGEND, TITLES, figures_of, per_type, percent, sentences, verdict
from rulec.study.tally import Cell, Tally


def show(
    out: Console, ruleset: Ruleset, types: Mapping[str, str], points: Points, counts: Tally
) -> None:
    """Print the findings in words, then a table per module type."""
    out.print(styled("\n[bold]{}[/]: what its diagnosis can do\n", ruleset.title))
    for sentence in sentences(counts):
        out.print(f"- {sentence}")
    free = [name for name in points.given if not ruleset.signal_by_id[name].is_input]
    if free:
        out.print(f"- No equation determines {', '.join(free)}: varied like inputs.")
    for kind, members, rows in per_type(counts, types):
        out.print(styled("\n[bold]{}[/] ({})", kind, members))
        out.print(_table(rows))
    out.print(styled("[dim]{}[/]", LEGEND))
    show_without(out, ruleset, without_each(ruleset))


def _table(rows: list[list[Cell]]) -> Table:
    table = Table(pad_edge=False, box=None, padding=(0, 1))
    table.add_column("fault", no_wrap=True)
    for title in TITLES:
        table.add_column(title, justify="right", no_wrap=True)
    for cells in rows:
        for i, cell in enumerate(cells):
            name = "" if i else cell.fault.title
            table.add_row(name, percent(cell.degree), str(cell.recordings), *figures_of(cell))
    return table


def study_form(
    ruleset: Ruleset, points: Points, settings: Settings, counts: Tally
) -> dict[str, Any]:
    """A study as JSON data; readings in SI. The `kinds` of a cell sum up to all its recordings."""
    return {
        "plant": ruleset.plant,
        "ruleset": ruleset.sources,
        "settings": asdict(settings),
        "points": [
            {name: float(values[i]) for name, values in points.given.items()}
            for i in range(len(points))
        ],
        "faults": [_cell(cell) for cell in counts.cells],
        "confusions": [asdict(confusion) for confusion in counts.confusions],
        "healthy": asdict(counts.healthy),
        "lead_in": asdict(counts.lead_in),
        "without": without_each(ruleset),
        "text": list(sentences(counts)),
    }


def _cell(cell: Cell) -> dict[str, Any]:
    counts = ("recordings", "found", "named", "shared", "covered")
    return {
        **asdict(cell.fault),
        "degree": cell.degree,
        "kinds": {kind.value: count for kind, count in cell.kinds.items()},
        **{name: getattr(cell, name) for name in counts},
        "error": cell.error if cell.named else None,
        "bias": cell.bias if cell.named else None,
    }


def study_page(
    ruleset: Ruleset,
    types: Mapping[str, str],
    points: Points,
    settings: Settings,
    counts: Tally,
    made: Made | None = None,
) -> str:
    """A study as HTML; the same study gives the same text. `types` are module types by module,
    `made` says when and by which tool the page was made."""
    items = "".join(f"<li>{safe(sentence)}</li>" for sentence in sentences(counts))
    sections = [
        section("What its diagnosis can do", f"<ul>{items}</ul>"),
        *_tables(types, counts),
        section("Where this comes from", facts(_facts(ruleset, points, settings))),
    ]
    head = Head(
        kind="Study of a diagnosis",
        verdict=verdict(counts),
        facts=tuple(Subject(ruleset=ruleset).facts()),
        made=made,
        sketch=sketch(ruleset, {}),
    )
    return document(head, "".join(sections))


def _tables(types: Mapping[str, str], counts: Tally) -> Iterator[str]:
    of = columns("fault", *(f".{title}" for title in TITLES))
    legend = f'<p class="soft">{safe(LEGEND)}</p>'
    for kind, members, rows in per_type(counts, types):
        name = f"{kind} ({members})"
        shown = (
            (cell.fault.title, percent(cell.degree), str(cell.recordings), *figures_of(cell))
            for cells in rows
            for cell in cells
        )
        yield section(safe(name), table(name, of, ([*map(safe, row)] for row in shown)) + legend)


def _facts(
    ruleset: Ruleset, points: Points, settings: Settings
) -> Iterator[tuple[str, Sequence[str]]]:
    signals = ruleset.signal_by_id
    yield "recordings", [f"simulated, {settings.samples} samples with the fault in each"]
    yield "plants drawn per fault", [str(settings.seeds)]
    yield "mode", [settings.mode]
    yield (
        "operating points",
        [
            ", ".join(
                f"{name} {signals[name].shown(float(values[i])):.4g} {signals[name].unit}"
                for name, values in points.given.items()
            )
            for i in range(len(points))
        ],
    )
    free = [name for name in points.given if not signals[name].is_input]
    if free:
        yield "varied like inputs", [f"{', '.join(free)}: no equation determines them"]
