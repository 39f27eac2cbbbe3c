"""What a reader must know first: verdict, findings, what is not recorded, the next step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rulec_runtime.report.html_story import badge
from rulec_runtime.report.text import listed, safe

from rulec.mismatch.answer.wording import (
    SORTS,
    degree_words,
    letter,
    meaning,
    periods_words,
    plausible,
    region_words,
    share,
    where,
)
from rulec.mismatch.result import Finding, HiddenDriver, Location, Mismatch


def told_first(mismatch: Mismatch) -> str:
    """Verdict and headline, a card per finding, the places, the next step."""
    style = letter(mismatch)
    headline = mismatch.headline or meaning(mismatch)
    parts = [
        f'<div class="status">{badge(style)}<p><strong>{safe(headline)}</strong>'
        f'<span class="soft">{safe(meaning(mismatch))}</span></p></div>'
    ]
    parts += [_card(style, f.text, _about(f)) for f in mismatch.findings]
    if mismatch.locations:
        rows = [row for location in mismatch.locations for row in _place(location)]
        parts.append(_card(style, "Where the mismatch sits", rows))
    if mismatch.hidden is not None:
        parts.append(_card(style, "What drives it is not recorded", _hidden(mismatch.hidden)))
    if mismatch.next:
        parts.append(_card(style, "Next", [("What to do", mismatch.next)]))
    return "".join(parts)


def _card(style: str, title: str, rows: Iterable[tuple[str, str]]) -> str:
    body = "".join(f"<dt>{term}</dt><dd>{safe(text)}</dd>" for term, text in rows)
    return f'<section class="finding is-{style}"><h3>{safe(title)}</h3><dl>{body}</dl></section>'


def _about(finding: Finding) -> Iterator[tuple[str, str]]:
    yield "What", f"{finding.title}: {SORTS.get(finding.sort, finding.sort)}"
    yield "Where", f"{finding.module}.{finding.place}"
    yield "How sure", share(finding.probability)
    others = [f"{a.title} ({share(a.probability)})" for a in plausible(finding)]
    if others:
        yield "Could also be", listed(others)
    for i, words in enumerate(degree_words(finding.periods)):
        yield "" if i else "When", words
    if finding.equation:
        yield "Equation", finding.equation
    if finding.action:
        yield "What to do", finding.action


def _place(location: Location) -> Iterator[tuple[str, str]]:
    yield "Place", where(location)
    if location.region:
        yield "Region", "; ".join(region_words(region) for region in location.region)
    if location.periods:
        yield "When", periods_words(location.periods)
    if location.also:
        yield "Not told apart from", listed(location.also)


def _hidden(hidden: HiddenDriver) -> Iterator[tuple[str, str]]:
    yield "Its course", hidden.text
    yield "It moves", f"{hidden.module}.{hidden.place}"
    if hidden.candidates:
        yield "Could be", listed(hidden.candidates)
    if hidden.sensor:
        yield "Sensor to add", hidden.sensor
