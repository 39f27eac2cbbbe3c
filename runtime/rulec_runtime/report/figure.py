"""A figure of the report: a picture with title, key and sentence."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.report.text import safe


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A picture as HTML, its title, how to read it, and the sentence below it."""

    name: str
    title: str
    key: str
    body: str
    caption: str
    narrow: bool = False
    tall: bool = False


def plot(svg: str, foot: bool, below: str = "time [s]") -> str:
    """A panel with room for its axes; the last of a stack says what the horizontal axis is."""
    label = f'<div class="below">{safe(below)}</div>' if foot else ""
    return f'<div class="plot">{svg}{label}</div>'
