"""What a reader must know first: verdict, findings, what is not recorded, the next step."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from rulec_runtime.report.text import safe

from rulec.mismatch.answer.wording import (
    finding_facts,
    hidden_facts,
    letter,
    meaning,
    place_facts,
    where_of,
)
from rulec.mismatch.result import Finding, Mismatch

SENTENCE = re.compile(r"(?<=[.])\s+(?=[A-Z])")
"""Between two sentences."""


def verdict(mismatch: Mismatch) -> tuple[str, str]:
    """The verdict in one sentence, and what else is to be said at once."""
    said = mismatch.headline or meaning(mismatch)
    first, *rest = SENTENCE.split(said, maxsplit=1)
    return first.removesuffix("."), " ".join([*rest, f"{meaning(mismatch)}."])


def marks(mismatch: Mismatch) -> dict[str, str]:
    """Modules in which something was found, with the letter of the verdict."""
    style = letter(mismatch)
    found = [name for f in mismatch.findings for name in (f.module, *f.members)]
    return dict.fromkeys([*found, *(at.module for at in mismatch.locations)], style)


def told_first(mismatch: Mismatch) -> str:
    """A card per finding, the places, the next step."""
    style = letter(mismatch)
    parts = [_card(style, f.text, _about(f)) for f in mismatch.findings]
    if mismatch.locations:
        rows = [row for location in mismatch.locations for row in place_facts(location)]
        parts.append(_card(style, "Where the mismatch sits", rows))
    if mismatch.hidden is not None:
        parts.append(_card(style, "What drives it is not recorded", hidden_facts(mismatch.hidden)))
    if mismatch.next:
        parts.append(_card(style, "Next", [("do", mismatch.next)]))
    return "".join(parts)


def _card(style: str, title: str, rows: Iterable[tuple[str, str]]) -> str:
    body = "".join(f"<dt>{term.capitalize()}</dt><dd>{safe(text)}</dd>" for term, text in rows)
    return f'<section class="finding is-{style}"><h3>{safe(title)}</h3><dl>{body}</dl></section>'


def _about(finding: Finding) -> Iterator[tuple[str, str]]:
    yield "what", finding.title
    yield "where", where_of(finding)
    yield from finding_facts(finding)
    if finding.equation and finding.sort != "free":
        yield "equation", finding.equation
