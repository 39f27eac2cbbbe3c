"""A story that is told on a console, kept as text: for notebooks, and for consoles of others."""

from __future__ import annotations

import io
from collections.abc import Callable

from rich.console import Console
from rich.text import Text

from rulec_runtime import limits
from rulec_runtime.output.terminal import Terminal

Story = Callable[[Console], object]
"""Prints itself on a console."""

_FRAME = (
    '<pre style="white-space:pre;overflow-x:auto;line-height:normal;'
    'font-family:Menlo,Consolas,monospace">{code}</pre>'
)


def plain(tell: Story, width: int = limits.STORY_WIDTH) -> str:
    """The story as text without styles."""
    file = io.StringIO()
    tell(Terminal(file=file, width=width, force_terminal=False))
    return file.getvalue().strip("\n")


def with_styles(tell: Story, width: int = limits.STORY_WIDTH) -> Text:
    """The story as one text, for the console of somebody else."""
    file = io.StringIO()
    tell(Terminal(file=file, width=width, force_terminal=True, color_system="standard"))
    return Text.from_ansi(file.getvalue().strip("\n"), no_wrap=True)


def as_html(tell: Story, width: int = limits.STORY_WIDTH) -> str:
    """The story for a notebook; whatever data says is shown as text."""
    console = Terminal(file=io.StringIO(), width=width, record=True, force_terminal=True)
    tell(console)
    return console.export_html(inline_styles=True, code_format=_FRAME)
