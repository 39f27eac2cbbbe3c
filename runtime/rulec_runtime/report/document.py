"""The frame of a page: one HTML file that needs neither network nor scripts."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from rulec_runtime.report.chart import SYMBOLS
from rulec_runtime.report.figure import Figure
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.text import safe

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
    symbol, `meaning` the line below. `facts` describe the subject, `made` when and by what the page
    was made, `sketch` (HTML) shows the plant.
    """

    kind: str
    verdict: str
    meaning: str = ""
    badge: str = ""
    facts: Sequence[tuple[str, str]] = ()
    made: Made | None = None
    sketch: str = ""


def document(head: Head, body: str) -> str:
    """A page as HTML; `body` are sections as HTML."""
    shapes = "".join(
        f'<symbol id="{k}" overflow="visible">{v}</symbol>' for k, v in SYMBOLS.items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}"/>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{safe(head.verdict)} ({safe(head.kind)})</title><style>\n{STYLE}</style></head>\n"
        f'<body><svg class="symbols" aria-hidden="true">{shapes}</svg>'
        f"{_header(head)}<main>{body}</main></body></html>\n"
    )


def _header(head: Head) -> str:
    rows = [(term, [text]) for term, text in head.facts]
    if head.made:
        rows.append(("Made", [f"{head.made.when} by {head.made.tool}"]))
    below = f'<p class="soft">{safe(head.meaning)}</p>' if head.meaning else ""
    long = ' class="long"' if len(head.verdict) > LONG else ""
    return (
        f'<header class="head"><p class="kind">{safe(head.kind)}</p>'
        f'<div class="status">{head.badge}<div><h1{long}>{safe(head.verdict)}</h1>{below}</div>'
        f'</div><div class="about">{facts(rows)}{head.sketch}</div></header>\n'
    )


def section(title: str, body: str) -> str:
    """A section with its heading."""
    return f"<section><h2>{title}</h2>{body}</section>\n"


def facts(rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """A list of terms with their texts; a term without texts is left out."""
    body = "".join(
        f"<dt>{safe(term)}</dt>" + "".join(f"<dd>{safe(text)}</dd>" for text in texts)
        for term, texts in rows
        if texts
    )
    return f"<dl>{body}</dl>"


def numbered(figures: Iterable[Figure], first: int = 1) -> Iterator[str]:
    """Figures with their numbers."""
    for i, figure in enumerate(figures, first):
        style = " ".join(["narrow"] * figure.narrow + ["tall"] * figure.tall)
        key = f'<p class="key">{safe(figure.key)}</p>' if figure.key else ""
        yield (
            f'<figure id="{figure.name}" class="{style}"><h3>{safe(figure.title)}</h3>{key}'
            f"{figure.body}<figcaption><b>Figure {i}.</b> {safe(figure.caption)}</figcaption>"
            "</figure>\n"
        )
