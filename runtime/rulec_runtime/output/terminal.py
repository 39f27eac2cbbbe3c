"""All text for a terminal: data is shown as written and cannot control the terminal.

Titles, file names, headers and cells come from files that anybody may have written. A console of
this module interprets no markup in them, and passes no character that moves the cursor, changes
colours or reverses the reading direction. Only our own templates hold styles (`styled`); data is
inserted as plain text.
"""

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
"""Replaces a character that is not shown."""

LONGEST = 2000
"""Most characters of one piece of data: a name of a megabyte would push the finding off the screen.
Assumed: a screen of 80 by 25."""

_OTHER = re.compile(r"[^ -~\n]")

_PERCENT, _HELD = re.compile(r"[ \u00a0](?=%)"), "\u2800"
"""The blank before a percent sign, and what replaces it until lines are broken: rich breaks at
no-break spaces too, but not at this blank Braille cell."""


class Terminal(Console):
    """A console for untrusted text: no markup unless `styled`, no control characters at all."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"highlight": False, "markup": False, "emoji": False, **options})

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Segments to show; only rich's own control segments control the terminal."""
        if isinstance(renderable, str | Text) and _PERCENT.search(str(renderable)):
            renderable = (
                self.render_str(renderable) if isinstance(renderable, str) else renderable.copy()
            )
            renderable.plain = _PERCENT.sub(_HELD, renderable.plain)
        for segment in super().render(renderable, options):
            # A nested table passes here once per table around it: most segments stay unchanged.
            is_plain = segment.control or _OTHER.search(segment.text) is None
            text = segment.text if is_plain else shown(segment.text).replace(_HELD, " ")
            yield segment if is_plain else segment._replace(text=text)


def terminal(aside: bool = False, quiet: bool = False) -> Terminal:
    """A console for standard output, or for standard error (`aside`); `quiet` prints nothing."""
    return Terminal(stderr=aside, quiet=quiet)


def say_aside(message: str) -> None:
    """Print mistakes and notes on standard error, without wrapping, as scripts read them."""
    terminal(aside=True).print(message, soft_wrap=True)


def styled(template: str, *data: object) -> Text:
    """A template with rich markup whose ``{}`` are filled with data, shown as written.

    >>> styled("[bold]{}[/]: found", "[/x]").plain
    '[/x]: found'
    """
    fields = (escape(one_line(str(part))) for part in data)
    return Text.from_markup(template.format(*fields), emoji=False)


def one_line(text: str) -> str:
    r"""Text on one line, without characters that control a terminal.

    >>> one_line("a\nb\x1b[31m")
    'a b\ufffd[31m'
    """
    short = text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
    return shown(" ".join(short.splitlines()).replace("\t", " "))


def shown(text: str) -> str:
    """Text without characters that control a terminal; line breaks are kept."""
    return _OTHER.sub(lambda found: found[0] if is_shown(found[0]) else SHOWN_INSTEAD, text)


def is_shown(character: str) -> bool:
    """Whether a terminal prints a character: no control, change of direction or lone surrogate.

    Source: Unicode categories Cc, Cf, Cs, Co, Cn, Zl, Zp are not printed; blanks of any width are.
    """
    return character.isprintable() or unicodedata.category(character) == "Zs"


def machine_text(text: str) -> str:
    """Equivalent JSON that escapes every character that controls a terminal."""
    return _OTHER.sub(lambda found: found[0] if is_shown(found[0]) else _escaped(found[0]), text)


def _escaped(character: str) -> str:
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[i] << 8 | units[i + 1]:04x}" for i in range(0, len(units), 2))


def write_machine_text(text: str) -> None:
    """Write JSON to standard output."""
    sys.stdout.write(machine_text(text))


def write_document(text: str) -> None:
    """Write the content of a file to standard output: the same bytes, but without control
    characters on a terminal."""
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
"""Prints a text on a console."""

_FRAME = (
    '<pre style="white-space:pre;overflow-x:auto;line-height:normal;'
    'font-family:Menlo,Consolas,monospace">{code}</pre>'
)


def plain(tell: Story, width: int = limits.STORY_WIDTH) -> str:
    """The story as unstyled text."""
    file = io.StringIO()
    tell(Terminal(file=file, width=width, force_terminal=False))
    return file.getvalue().strip("\n")


def with_styles(tell: Story, width: int) -> Text:
    """The story as one styled text, for another console."""
    file = io.StringIO()
    tell(Terminal(file=file, width=width, force_terminal=True, color_system="standard"))
    return Text.from_ansi(file.getvalue().strip("\n"), no_wrap=True)


def as_html(tell: Story) -> str:
    """The story for a notebook; data is shown as text."""
    file = io.StringIO()
    console = Terminal(file=file, width=limits.STORY_WIDTH, record=True, force_terminal=True)
    tell(console)
    return console.export_html(inline_styles=True, code_format=_FRAME)
