"""`rulec matrix`: the fault-symptom matrix with gains, detectable degrees and ambiguities."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.padding import Padding
from rulec_runtime import limits
from rulec_runtime.commands.destinations import (
    check_outputs,
    console,
    show_files,
    write_json,
    write_to,
)
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.document import Head, document
from rulec_runtime.report.matrix import (
    ANY_ERROR,
    KINDS,
    Named,
    marked,
    matrix_of,
    matrix_table,
    narrow,
)
from rulec_runtime.report.page_origin import made_now
from rulec_runtime.report.parts import Content, Part, Table, Words, shown
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import counted, listed

from rulec.limits import MOST_RULES
from rulec.passes.compile_cache import ruleset_of_plant, saved_of_plant
from rulec.study.sensors_needed import Without, show_without, without_each

if TYPE_CHECKING:
    from rulec.separation.table import Separated


def run(options: argparse.Namespace) -> int:
    """Show the matrix of a plant."""
    if options.limits is not None and not options.separate:
        raise Misused("--limits are limits of --separate; give both")
    check_outputs(options)
    plant = Path(options.plant)
    ruleset = ruleset_of_plant(plant)
    stores, without = _of_stores(ruleset, plant), _without(ruleset, plant)
    pairs = separated(ruleset, options.limits) if options.separate else None
    if options.report:
        write_to(options.report, matrix_page(ruleset, made_now("rulec"), stores))
    form = {**json_form(ruleset, stores), "without": without}
    out, is_shown = console(options), options.json != "-"
    if pairs is None:
        write_json(options, form)
        if is_shown:
            show(out, ruleset, stores)
            show_without(out, ruleset, without)
    else:
        from rulec.separation.table import separated_form, show_separated

        write_json(options, {**form, "separate": separated_form(ruleset, pairs)})
        if is_shown:
            show_separated(out, ruleset, pairs)
    show_files(out, {"report": options.report})
    return 0


def separated(ruleset: Ruleset, limits: str | None) -> list[Separated]:
    """Pairs of faults that are alike, each with the step that separates it best."""
    from rulec.separation.allowed import allowed_of
    from rulec.separation.table import separate_pairs
    from rulec.simulation.equations import SimulationRefused

    if ruleset.dynamics is not None:
        raise SimulationRefused(
            f"{ruleset.plant} has storage; set points can be compared only without storage"
        )
    given = None
    if limits is not None:
        from rulec.separation.limits_file import read_limits  # reads YAML

        given = read_limits(Path(limits), ruleset)
    return list(separate_pairs(ruleset, allowed_of(ruleset, given)))


def json_form(ruleset: Ruleset, stores: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The matrix as JSON data; rows are faults, columns are residuals.

    For a plant that stores, `stores` holds the same for the readings that balances predict.
    """
    units = [fault.unit for fault in ruleset.faults]
    unlisted = {  # sensor errors that no module lists
        "faults": [f.id for f in ruleset.unlisted],
        "units": [f.unit or "1" for f in ruleset.unlisted],
        **_cells(ruleset, ruleset.unlisted),
    }
    return {
        **({"stores": stores} if stores else {}),
        "plant": ruleset.plant,
        "residuals": [r.id for r in ruleset.residuals],
        "faults": [f.id for f in ruleset.faults],
        **({"units": [unit or "1" for unit in units]} if any(units) else {}),
        **_cells(ruleset, ruleset.faults),
        "ambiguous": [list(g.faults) for g in ruleset.ambiguous],
        "ambiguities": [
            {
                "faults": list(g.faults),
                "kind": g.kind,
                "advice": g.advice,
                "told_from": list(g.degrees),
            }
            for g in ruleset.ambiguous
        ],
        "advice": [
            {
                "faults": list(g.faults),
                "sensors": [dataclasses.asdict(s) for s in g.sensors],
                "text": g.advice,
            }
            for g in ruleset.ambiguous
            if g.sensors
        ],
        "unobserved": list(ruleset.unobserved),
        **({"unlisted": unlisted} if ruleset.unlisted else {}),
    }


def _cells(ruleset: Ruleset, faults: Sequence[FaultSpec]) -> dict[str, list[list[Any]]]:
    """Dense matrices, a row per fault and a column per residual."""
    rows = [{c.residual: c for c in ruleset.cells_of_fault[fault.id]} for fault in faults]
    return {
        name: [
            [getattr(row[r.id], part) if r.id in row else absent for r in ruleset.residuals]
            for row in rows
        ]
        for name, part, absent in (
            ("signs", "sign", 0),
            ("gains", "gain", 0),
            ("detectable", "detectable", None),
        )
    }


def _without(ruleset: Ruleset, plant: Path) -> Without:
    """What each sensor is needed for; cached if that takes longer than to look it up."""
    if ruleset.dynamics is None and len(ruleset.observers) <= limits.NEAREST_ESTIMATES:
        return without_each(ruleset)
    found: Without = saved_of_plant(plant, "without", lambda: without_each(ruleset))
    return found


def _of_stores(ruleset: Ruleset, plant: Path) -> Mapping[str, Any] | None:
    """How faults change the readings that balances predict, as JSON data of a `Signature`.

    None if nothing is stored, or if the balances cannot be integrated.
    """
    if ruleset.dynamics is None:
        return None

    def followed() -> Mapping[str, Any]:
        # The integrator takes a second to load, and plants that store nothing do not need it.
        from rulec.simulation.signature import signature_of

        found = signature_of(ruleset)
        return {} if found is None else dataclasses.asdict(found)

    found: Mapping[str, Any] = saved_of_plant(plant, "stores", followed)
    return found or None


def show(out: Console, ruleset: Ruleset, stores: Mapping[str, Any] | None = None) -> None:
    """Draw the matrix: sign and smallest detectable degree of each cell."""
    what = "reading" if ruleset.dynamics is not None else "residual"
    out.print(styled("\n[bold]{}[/]: how each fault moves each {}\n", ruleset.title, what))
    if stores:
        readings = [f":{name}" for name in stores["readings"]]
        out.print(shown(Table(("fault", *readings), list(_signs_of(stores)))))
        out.print(styled("[dim]{}[/]", STORES_LEGEND))
        for group in stores["alike"]:
            out.print(f"  {', '.join(group)}: act alike on all readings")
    if ruleset.dynamics is not None and not ruleset.residuals:
        return
    residuals = ruleset.residuals
    longest = max(map(len, (*(f.id for f in ruleset.faults), *ruleset.moved_by_reading)), default=0)
    wide = max((len(line) for r in residuals for line in narrow(r.id).split("\n")), default=0) + 2
    fitting = max(3, (out.width - longest) // wide)
    for start in range(0, len(residuals), fitting):
        some = residuals[start : start + fitting]
        out.print(shown(matrix_table(ruleset, ruleset.faults, some, Named())))
    legend = (
        "+ residual rises, - residual falls, · no effect; the number below a sign is "
        "the smallest degree that exceeds the threshold at the reference point"
    )
    if ruleset.unlisted:
        legend += f"; ± {ANY_ERROR}"
    out.print(styled("[dim]{}[/]", legend))
    if omitted := left_out(ruleset):
        out.print(styled("[dim]{}[/]", omitted))
    _show_ambiguous(out, ruleset)
    for name in ruleset.unobserved:
        out.print(styled("[yellow]![/] {}: no residual sees it", name))


def _show_ambiguous(out: Console, ruleset: Ruleset) -> None:
    for kind, (_, title, why) in KINDS.items():
        groups = [g for g in ruleset.ambiguous if g.kind == kind]
        between = " in " if kind == "nested" else ", "
        if groups:
            out.print(styled("\n[bold]{}[/] ({})", title.capitalize(), why))
        for group in groups:
            out.print(Padding(f"{between.join(group.faults)}: {group.advice}", (0, 0, 0, 2)))
    costs = {(s.module, s.signal): s.cost for g in ruleset.ambiguous for s in g.sensors}
    if costs:
        each = ", ".join(f"{m}.{s} {cost:g}" for (m, s), cost in costs.items())
        out.print(styled("\n[bold]Sensors that would help[/], with their relative cost: {}", each))


STORES_LEGEND = "+ the reading is higher than the balances predict, - lower, · as they do"
SIGNS = {1: "+", -1: "-", 0: "·"}


def _signs_of(stores: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Each fault with the signs by which it changes readings."""
    for fault, signs in zip(stores["faults"], stores["signs"], strict=True):
        yield fault, *map(SIGNS.__getitem__, signs)


def matrix_page(ruleset: Ruleset, made: str = "", stores: Mapping[str, Any] | None = None) -> str:
    """The page as HTML; the same ruleset gives the same text. For a plant that stores, `stores` is
    JSON data on how faults change the readings that balances predict."""
    parts = []
    if stores is not None:
        parts.append(Part("What each fault does to readings", _stores(stores)))
    if ruleset.residuals:
        omitted = left_out(ruleset)
        note = [Words(omitted, soft=True)] if omitted else []
        shown = matrix_of(ruleset, Named(), whole=True)
        parts.append(Part("What each fault does", [*shown, *note]))
    if ruleset.unobserved:
        parts.append(Part("What no residual sees", [Words(listed(ruleset.unobserved))]))
    head = Head(
        kind="Fault-symptom matrix",
        verdict=verdict(ruleset, stores),
        meaning=_meaning(ruleset),
        subject=Subject(ruleset=ruleset),
        made=made,
    )
    return document(head, parts)


def _stores(stores: Mapping[str, Any]) -> list[Content]:
    """The signs for a page; faults that act alike have the same mark."""
    marks, rows = dict(zip(ascii_lowercase, stores["alike"], strict=False)), []
    for fault, *signs in _signs_of(stores):
        own = " ".join(f"={mark}" for mark, names in marks.items() if fault in names)
        rows.append((fault, own, *signs))
    titles = ("fault", "alike", *(f":{name}" for name in stores["readings"]))
    key = "+ the reading stands higher than the balances predict, − lower, · as they do"
    return [
        Words(f"{key}; faults with one mark act alike on all readings", soft=True),
        Table(titles, rows, "faults and the readings that they change", style="matrix"),
    ]


def left_out(ruleset: Ruleset) -> str:
    """What the matrix of a long plant omits; empty if it shows everything."""
    if max(map(len, ruleset.cells_of_fault.values()), default=0) < MOST_RULES:
        return ""
    return f"a fault has the {MOST_RULES} residuals that tell it first; it may move others as well"


def verdict(ruleset: Ruleset, stores: Mapping[str, Any] | None = None) -> str:
    """Whether all faults can be told apart."""
    same = {name for g in ruleset.ambiguous if g.kind == "coincide" for name in g.faults}
    same |= {name for names in (stores["alike"] if stores else ()) for name in names}
    count = len(ruleset.faults)
    if same:
        return f"{len(same)} of {counted(count, 'fault')} cannot be told from another one"
    if not ruleset.ambiguous:
        return f"All {counted(count, 'fault')} can be told apart"
    return f"All {counted(count, 'fault')} can be told apart, some only where they are large"


def _meaning(ruleset: Ruleset) -> str:
    groups, invisible = len(marked(ruleset)), len(ruleset.unobserved)
    parts = [f"{counted(groups, 'group')} of faults that are alike"] if groups else []
    parts += [f"{counted(invisible, 'fault')} without any trace"] if invisible else []
    return "; ".join(parts)
