"""The page of a fault-symptom matrix: how much can be told apart, the matrix, and what is alike."""

from __future__ import annotations

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.report.document import Head, document, section
from rulec_runtime.report.made import Made
from rulec_runtime.report.matrix import Named, marked, matrix_of
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import counted, listed, safe

SAME = "coincide"
"""Kind of a group whose members do the same at any degree."""


def matrix_page(ruleset: Ruleset, made: Made | None = None) -> str:
    """The page as HTML; the same ruleset gives the same text."""
    sections = [section("What each fault does", matrix_of(ruleset, Named(), whole=True))]
    if ruleset.unobserved:
        names = safe(listed(ruleset.unobserved))
        sections.append(section("What no residual sees", f"<p>{names}</p>"))
    head = Head(
        kind="Fault-symptom matrix",
        verdict=verdict(ruleset),
        meaning=_meaning(ruleset),
        facts=tuple(Subject(ruleset=ruleset).facts()),
        made=made,
        sketch=sketch(ruleset, {}),
    )
    return document(head, "".join(sections))


def verdict(ruleset: Ruleset) -> str:
    """Whether all faults can be told apart."""
    same = {name for g in ruleset.ambiguous if g.kind == SAME for name in g.faults}
    count = len(ruleset.faults)
    if same:
        return f"{len(same)} of {counted(count, 'fault')} cannot be told from another one"
    if not ruleset.ambiguous:
        return f"All {counted(count, 'fault')} can be told apart"
    return f"All {counted(count, 'fault')} can be told apart, some only where they are large"


def _meaning(ruleset: Ruleset) -> str:
    """How many groups are alike, and what is not seen at all."""
    groups, unseen = len(marked(ruleset)), len(ruleset.unobserved)
    parts = [f"{counted(groups, 'group')} of faults that are alike"] if groups else []
    parts += [f"{counted(unseen, 'fault')} without any trace"] if unseen else []
    return "; ".join(parts)
