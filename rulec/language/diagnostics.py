"""Mistakes in knowledge and plant files, as values with their places."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from rulec_runtime.output.open_file import begin_of
from rulec_runtime.output.refusal import Refusal

from rulec.language.limits import MAX_DIAGNOSTICS, MAX_MESSAGE_LENGTH
from rulec.limits import MAX_FILE_BYTES

WIDTH = 96

KINDS = (
    "module", "fault", "effect", "sensor", "fluid", "plant", "columns", "calibration", "limits",
    "fleet", "units",
)  # fmt: skip
"""Kinds of files, named by the top-level key that identifies each."""

_OURS = re.compile(rf"""^(?:\{{\s*)?(["']?)(?:{"|".join(KINDS)})\1[ \t]*:(?:\s|\Z)""", re.MULTILINE)

_LINE_END = re.compile("\r\n|[\n\r\x85\u2028\u2029]")


@dataclass(frozen=True, order=True)
class Place:
    """A position in a text file; `line` and `column` count from 1."""

    file: str
    line: int = 1
    column: int = 1
    length: int = 1


@dataclass(frozen=True, order=True)
class Diagnostic:
    """One mistake or doubt, with its place.

    `code` identifies the reason (docs/errors.md); `hint` is the remedy; `second` is the other
    place where two contradict each other. A `doubt` is only a warning: nothing is refused for it.
    """

    place: Place
    code: str
    message: str
    hint: str = ""
    second: Place | None = field(default=None, compare=False)
    doubt: bool = False


class Refused(Refusal):
    """Raised at the end of a pass that found mistakes; carries all of them."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(sorted(set(diagnostics)))
        super().__init__(self.diagnostics)

    def __str__(self) -> str:
        return render_all(self.diagnostics)

    def for_terminal(self) -> str:
        """All mistakes, each with its place and remedy."""
        return str(self)

    @property
    def briefly(self) -> str:
        """The first three mistakes, in one line and without their places."""
        return "; ".join(d.message for d in self.diagnostics[:3])


def is_ours(text: str) -> bool:
    """Whether a text looks like a file of this tool, without parsing it.

    Other files are never quoted: a plant may name any file whose content its author wants to see.

    >>> is_ours("plant: p"), is_ours("root:x:0:0"), is_ours("{'units': {}}")
    (True, False, True)
    """
    return _OURS.search(text) is not None


def no_file_of_ours(
    place: Place, near: str | None = None, second: Place | None = None
) -> Diagnostic:
    """A file is not of this tool; `near` is the key that was meant, `second` what names it."""
    hint = f"did you mean '{near}'?" if near else "first key: " + ", ".join(KINDS)
    if Path(place.file).suffix not in (".yaml", ".yml"):
        hint = "it is no YAML file; if it is a recording, give the plant first: PLANT RECORDING"
    return Diagnostic(place, "KB012", "this is not a file of this tool", hint, second)


def render(diagnostic: Diagnostic) -> str:
    """Write a diagnostic as text: place, message, excerpt with caret, remedy."""
    place, second = diagnostic.place, diagnostic.second
    message = _shortened(diagnostic.message)
    whole = place == Place(place.file)  # the file, not a part of it
    at = place.file if whole else f"{place.file}:{place.line}:{place.column}"
    head = f"{diagnostic.code} {at}: {message}"
    lines = [head, *_excerpt(place, _shortened(diagnostic.hint))]
    if second is not None:
        lines.append(f"  see also {second.file}:{second.line}:{second.column}")
        lines.extend(_excerpt(second, ""))
    return "\n".join(_printable(line) for line in lines)


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_MESSAGE_LENGTH else text[:MAX_MESSAGE_LENGTH] + "..."


def render_all(diagnostics: Iterable[Diagnostic]) -> str:
    """Write all diagnostics, sorted by place, with a closing count."""
    found = sorted(set(diagnostics))
    files = len({d.place.file for d in found})
    doubts = sum(d.doubt for d in found)
    kinds = (("mistake", len(found) - doubts), ("warning", doubts))
    counted = [f"{count} {kind}{'s' * (count != 1)}" for kind, count in kinds if count]
    counted = counted or ["0 mistakes"]
    count = f"{' and '.join(counted)} in {files} file{'s' * (files != 1)}"
    if len(found) > MAX_DIAGNOSTICS:
        count += f", of which the first {MAX_DIAGNOSTICS} are shown"
    return "\n".join([*(render(d) for d in found[:MAX_DIAGNOSTICS]), count])


def split_lines(text: str) -> list[str]:
    """Lines as YAML counts them, which differs slightly from Python."""
    return _LINE_END.split(text)


def _excerpt(place: Place, hint: str) -> list[str]:
    """Quote the line of a place, if in a file of ours, with a caret under the offending part."""
    bare = [f"  {hint}"] if hint else []
    try:
        whole = begin_of(place.file, MAX_FILE_BYTES).decode("utf-8-sig", "replace")
    except (OSError, ValueError):
        return bare
    text = split_lines(whole)
    if not 1 <= place.line <= len(text) or not is_ours(whole):
        return bare
    source = text[place.line - 1]
    start = min(place.column - 1, len(source))
    shift = max(0, start - 60)
    shown = source[shift : shift + WIDTH].replace("\t", " ")
    shown = "..." * bool(shift) + shown[3 * bool(shift) :]
    shown += "..." * (shift + WIDTH < len(source))
    length = max(1, min(place.length, len(shown) - (start - shift)))
    gutter = f"{place.line:>5} | "
    caret = " " * (len(gutter) - 2) + "| " + " " * (start - shift) + "^" * length
    return [(gutter + shown).rstrip(), f"{caret} {hint}".rstrip()]


def _printable(text: str) -> str:
    """Replace control characters: a hostile file must not control the terminal."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


@dataclass(frozen=True)
class Origin:
    """Where a derived value comes from: file, line and citation."""

    file: str
    line: int
    source: str = ""
