"""The frame of a page: one HTML file that needs neither network nor scripts."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rulec_runtime.report.chart import SYMBOLS
from rulec_runtime.report.parts import Facts, Part, html, part_html
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import Html, safe
from rulec_runtime.report.wording import STATUS

STYLE = Path(__file__).with_name("style.css").read_text(encoding="utf-8")
"""Colours of series follow Okabe and Ito (2008), distinct for all common kinds of colour vision;
each series has its own stroke as well."""

POLICY = "default-src 'none'; style-src 'unsafe-inline'"
"""Forbids the browser to load anything, in case a name ever slips through unescaped."""

LONG = 70
"""Most characters of a verdict in large type."""


@dataclass(frozen=True, kw_only=True)
class Head:
    """The head of a page.

    `kind` is that of the page, `verdict` its result in one sentence, `badge` (HTML) the same as a
    symbol, `meaning` the line below. A `subject` is described and drawn, with `marks`, letters of
    NE 107 by module; `facts` follow. `made` says when and by what the page was made, if it is not
    empty.
    """

    kind: str
    verdict: str
    meaning: str = ""
    badge: str = ""
    subject: Subject | None = None
    marks: Mapping[str, str] = field(default_factory=dict)
    facts: Sequence[tuple[str, str]] = ()
    made: str = ""


def badge(letter: str, small: bool = False) -> Html:
    """Symbol and letter of NE 107."""
    style = "badge small" if small else "badge"
    return Html(f'<span class="{style} is-{letter}">{STATUS[letter][0]} {letter}</span>')


def document(head: Head, parts: Iterable[Part]) -> str:
    """A page as HTML."""
    shapes = "".join(
        f'<symbol id="{k}" overflow="visible">{v}</symbol>' for k, v in SYMBOLS.items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}"/>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{safe(head.verdict)} ({safe(head.kind)})</title><style>\n{STYLE}</style></head>\n"
        f'<body><svg class="symbols" aria-hidden="true">{shapes}</svg>'
        f"{_header(head)}<main>{''.join(map(part_html, parts))}</main></body></html>\n"
    )


def _header(head: Head) -> str:
    about = [*(head.subject.facts() if head.subject else ()), *head.facts]
    rows = [(term, [text]) for term, text in (*about, ("Made", head.made)) if text]
    drawn = sketch(head.subject.ruleset, head.marks) if head.subject else ""
    below = f'<p class="soft">{safe(head.meaning)}</p>' if head.meaning else ""
    long = ' class="long"' if len(head.verdict) > LONG else ""
    return (
        f'<header class="head"><p class="kind">{safe(head.kind)}</p>'
        f'<div class="status">{head.badge}<div><h1{long}>{safe(head.verdict)}</h1>{below}</div>'
        f'</div><div class="about">{html(Facts(rows))}{drawn}</div></header>\n'
    )
