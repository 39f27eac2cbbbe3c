"""All text for a terminal: what data says is shown as written, and steers nothing.

Titles, file names, headers and cells come from files that anybody may have written. A console of
this module takes no markup from them, and no character reaches the terminal that moves its cursor,
changes its colours or turns the direction of reading. Styles stand in templates of our own
(`styled`), into which data is put as plain text.
"""

from __future__ import annotations

import io
import re
import sys
import unicodedata
from collections.abc import Callable, Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.markup import escape
from rich.segment import Segment
from rich.text import Text

from rulec_runtime import limits

SHOWN_INSTEAD = "\N{REPLACEMENT CHARACTER}"
"""Stands where a character was that is not shown."""

LONGEST = 2000
"""Characters of one piece of data at most: a name of a megabyte would push the finding off the
screen. Assumed: a screen of 80 by 25."""

_OTHER = re.compile(r"[^ -~\n]")


class Terminal(Console):
    """A console for untrusted text: no markup unless `styled`, no control characters at all."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"highlight": False, "markup": False, "emoji": False, **options})

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Segments of what is shown; only rich's own control segments steer the terminal."""
        for segment in super().render(renderable, options):
            # Parts of a table come by here once for each table around them: most stay as they are.
            is_plain = segment.control or _OTHER.search(segment.text) is None
            yield segment if is_plain else segment._replace(text=shown(segment.text))


def terminal(aside: bool = False, quiet: bool = False) -> Terminal:
    """The console of standard output; `aside`, of standard error; `quiet`, of nobody."""
    return Terminal(stderr=aside, quiet=quiet)


def say_aside(message: str) -> None:
    """Lines for standard error: mistakes and notes. They are not wrapped: scripts read them."""
    terminal(aside=True).print(message, soft_wrap=True)


def styled(template: str, *data: object) -> Text:
    """A template with rich markup, its ``{}`` filled with data, which is shown as written.

    >>> styled("[bold]{}[/]: found", "[/x]").plain
    '[/x]: found'
    """
    return Text.from_markup(template.format(*(_field(part) for part in data)), emoji=False)


def _field(part: object) -> str:
    return escape(one_line(str(part)))


def one_line(text: str) -> str:
    r"""Text on one line, without characters that a terminal would obey.

    >>> one_line("a\nb\x1b[31m")
    'a b\ufffd[31m'
    """
    short = text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
    return shown(" ".join(short.splitlines()).replace("\t", " "))


def shown(text: str) -> str:
    """Text whose every character is shown; lines stay lines."""
    return _OTHER.sub(lambda found: found[0] if is_shown(found[0]) else SHOWN_INSTEAD, text)


def is_shown(character: str) -> bool:
    """Whether a terminal prints a character: no control, no turn of direction, no half of a pair.

    Source: Unicode categories Cc, Cf, Cs, Co, Cn, Zl, Zp are not; blanks of any width are.
    """
    return character.isprintable() or unicodedata.category(character) == "Zs"


def machine_text(text: str) -> str:
    """JSON with every character escaped that a terminal would obey; it says the same."""
    return _OTHER.sub(lambda found: found[0] if is_shown(found[0]) else _escaped(found[0]), text)


def _escaped(character: str) -> str:
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[i] << 8 | units[i + 1]:04x}" for i in range(0, len(units), 2))


def write_machine_text(text: str) -> None:
    """Put a machine form on standard output."""
    sys.stdout.write(machine_text(text))


def write_document(text: str) -> None:
    """Put what would be a file on standard output: the same bytes, but on a terminal, which obeys
    nothing that stands in it."""
    if sys.stdout.isatty():
        sys.stdout.write(shown(text))
        return
    raw = getattr(sys.stdout, "buffer", None)
    if raw is None:
        sys.stdout.write(text)
        return
    sys.stdout.flush()
    raw.write(text.encode("utf-8", "backslashreplace"))
    raw.flush()


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
