"""The frame of a report: one HTML file that needs nothing else, neither network nor scripts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from rulec_runtime.report.chart import SYMBOLS
from rulec_runtime.report.figure import Figure
from rulec_runtime.report.style import STYLE
from rulec_runtime.report.text import safe

POLICY = "default-src 'none'; style-src 'unsafe-inline'"
"""Forbids the browser to load anything, should a name ever slip through unescaped."""


def document(title: str, name: str, what: str, body: str) -> str:
    """A page as HTML.

    Parameters
    ----------
    title : of the plant.
    name : of the recording, as its reader knows it.
    what : the page is, in one word.
    body : sections as HTML.
    """
    shapes = "".join(
        f'<symbol id="{k}" overflow="visible">{v}</symbol>' for k, v in SYMBOLS.items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}"/>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{safe(name)}: {what}</title><style>\n{STYLE}</style></head>\n<body>"
        f'<svg class="symbols" aria-hidden="true">{shapes}</svg>'
        f'<header><h1>{safe(title)}</h1><span class="soft">{safe(name)}</span></header>\n'
        f"<main>{body}</main></body></html>\n"
    )


def section(title: str, body: str) -> str:
    """A section with its heading."""
    return f"<section><h2>{title}</h2>{body}</section>\n"


def facts(rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Terms with what is to be said of each; a term without anything is left out."""
    body = "".join(
        f"<dt>{term}</dt>" + "".join(f"<dd>{safe(text)}</dd>" for text in texts)
        for term, texts in rows
        if texts
    )
    return f"<dl>{body}</dl>"


def numbered(figures: Iterable[Figure]) -> Iterator[str]:
    """Figures with their numbers."""
    for i, figure in enumerate(figures, 1):
        style = " ".join(
            word for word, on in (("narrow", figure.narrow), ("tall", figure.tall)) if on
        )
        key = f'<p class="key">{safe(figure.key)}</p>' if figure.key else ""
        yield (
            f'<figure id="{figure.name}" class="{style}"><h3>{safe(figure.title)}</h3>{key}'
            f"{figure.body}<figcaption><b>Figure {i}.</b> {safe(figure.caption)}</figcaption>"
            "</figure>\n"
        )
