"""The page of a fault-symptom matrix: which faults can be told apart, and what each one moves."""

from __future__ import annotations

from collections.abc import Mapping
from string import ascii_lowercase
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.report.document import Head, document, section
from rulec_runtime.report.matrix_html import Named, marked, matrix_of
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.tables import framed
from rulec_runtime.report.text import counted, listed, safe

from rulec.limits import MOST_RULES

SIGNS = {1: "<b>+</b>", -1: "<b>−</b>", 0: '<span class="soft">·</span>'}


def matrix_page(
    ruleset: Ruleset, made: Made | None = None, stores: Mapping[str, Any] | None = None
) -> str:
    """The page as HTML; the same ruleset gives the same text. For a plant that stores, `stores` is
    JSON data on how faults change the readings that balances predict."""
    sections = []
    if stores is not None:
        sections.append(section("What each fault does to readings", _of_stores(stores)))
    if ruleset.residuals:
        omitted = left_out(ruleset)
        note = f'<p class="key">{safe(omitted)}</p>' if omitted else ""
        shown = matrix_of(ruleset, Named(), whole=True)
        sections.append(section("What each fault does", shown + note))
    if ruleset.unobserved:
        names = safe(listed(ruleset.unobserved))
        sections.append(section("What no residual sees", f"<p>{names}</p>"))
    head = Head(
        kind="Fault-symptom matrix",
        verdict=verdict(ruleset, stores),
        meaning=_meaning(ruleset),
        facts=tuple(Subject(ruleset=ruleset).facts()),
        made=made,
        sketch=sketch(ruleset, {}),
    )
    return document(head, "".join(sections))


def left_out(ruleset: Ruleset) -> str:
    """What the matrix of a long plant omits; empty if it shows everything."""
    if max(map(len, ruleset.cells_of_fault.values()), default=0) < MOST_RULES:
        return ""
    return f"a fault has the {MOST_RULES} residuals that tell it first; it may move others as well"


def _of_stores(stores: Mapping[str, Any]) -> str:
    """The signs by which faults change readings; faults that act alike have the same mark."""
    marks = dict(zip(ascii_lowercase, stores["alike"], strict=False))
    head = "".join(f'<th scope="col">{safe(name)}</th>' for name in stores["readings"])
    rows = []
    for fault, signs in zip(stores["faults"], stores["signs"], strict=True):
        own = " ".join(f'<b class="alike">={m}</b>' for m, names in marks.items() if fault in names)
        cells = "".join(f"<td>{SIGNS[sign]}</td>" for sign in signs)
        rows.append(f'<tr><th scope="row">{safe(fault)}</th><td>{own}</td>{cells}</tr>')
    shown = framed(
        "faults and the readings that they change",
        '<table class="matrix"><thead><tr><th scope="col">fault</th><th scope="col">alike</th>'
        f"{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>",
    )
    key = "+ the reading stands higher than the balances predict, − lower, · as they do"
    return f'<p class="key">{key}; faults with one mark act alike on all readings</p>{shown}'


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
