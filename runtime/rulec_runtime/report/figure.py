"""A figure of the report: a picture with title, key and caption."""

from dataclasses import dataclass

from rulec_runtime.report.text import safe


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A picture as HTML with its title, the key to reading it, and the caption."""

    name: str
    title: str
    key: str
    body: str
    caption: str
    narrow: bool = False
    tall: bool = False


def plot(svg: str, foot: bool, below: str, deep: bool = False) -> str:
    """A panel with room for its axes; the last of a stack (`foot`) has the title of the horizontal
    axis, further down if labels are `deep`."""
    label = f'<div class="below">{safe(below)}</div>' if foot else ""
    return f'<div class="plot{" deep" * deep}">{svg}{label}</div>'
