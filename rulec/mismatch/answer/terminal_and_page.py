"""The story on the terminal and as a page, which also has pictures."""

import re

from rich.console import Console
from rulec_runtime.output.terminal import styled
from rulec_runtime.report import parts as of_story
from rulec_runtime.report.chart import figures_html
from rulec_runtime.report.document import Head, badge, document
from rulec_runtime.report.parts import Part
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.wording import COLOURS, STATUS

from rulec.mismatch.answer.pictures import pictures_of
from rulec.mismatch.answer.story import story
from rulec.mismatch.answer.wording import letter, meaning
from rulec.mismatch.result import Mismatch


def tell(out: Console, mismatch: Mismatch) -> None:
    """Print the story in brief."""
    colour, symbol = COLOURS[letter(mismatch)], STATUS[letter(mismatch)][0]
    out.print(styled("\n[bold {}]{} {}[/]", colour, symbol, meaning(mismatch)))
    out.print(styled("[dim]{}, {}[/]", mismatch.title, mismatch.recording))
    if mismatch.headline:
        out.print(styled("\n[bold]{}[/]", mismatch.headline))
    of_story.tell(out, story(mismatch, brief=True), margin=2)


def report(mismatch: Mismatch, subject: Subject, made: str = "") -> str:
    """The page as HTML; the same comparison gives the same text.

    Parameters
    ----------
    subject : the plant as its file says, and the recording.
    made : when and by what it was made; left out if empty.
    """
    every = story(mismatch, brief=False)
    parts = [part for part in every if part.letter]
    if figures := pictures_of(mismatch, subject.calendar):
        parts.append(Part("Pictures", [figures_html(figures)]))
    parts += [part for part in every if not part.letter]
    first, more = verdict(mismatch)
    found = [name for f in mismatch.findings for name in (f.module, *f.members)]
    found += [location.module for location in mismatch.locations]
    head = Head(
        kind="Mismatch of simulation and recording",
        verdict=first,
        meaning=more,
        badge=badge(letter(mismatch)),
        subject=subject,
        marks=dict.fromkeys(found, letter(mismatch)),
        made=made,
    )
    return document(head, parts)


def verdict(mismatch: Mismatch) -> tuple[str, str]:
    """The verdict in one sentence, and what must follow at once."""
    text = mismatch.headline or meaning(mismatch)
    first, *rest = re.split(r"(?<=[.])\s+(?=[A-Z])", text, maxsplit=1)
    return first.removesuffix("."), " ".join([*rest, f"{meaning(mismatch)}."])
