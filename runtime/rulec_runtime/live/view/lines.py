"""Events as lines, where there is no terminal to draw on."""

from __future__ import annotations

from collections.abc import Iterator

from rich.text import Text

from rulec_runtime.live.event_forms import line_of
from rulec_runtime.live.now import Now
from rulec_runtime.live.view.words import lead, link, overall
from rulec_runtime.output.terminal import styled


def event_lines(now: Now, behind: int) -> Iterator[Text]:
    """Events with a number beyond `behind`, oldest first."""
    new = [event for event in reversed(now.past) if event.number > behind]
    if new and behind and new[0].number > behind + 1:
        yield styled(
            "[dim]{} events in between stand in the journal[/]", new[0].number - behind - 1
        )
    for event in new:
        yield line_of(event, now.calendar)


def last_number(now: Now, known: int) -> int:
    """Number of the last event that has been told."""
    return max([known, *(event.number for event in now.past)])


def closing_line(now: Now) -> Text:
    """How it stood when nobody looked any more."""
    symbol, letter, meaning = overall(now)
    status = " ".join(part for part in (symbol, letter, meaning) if part)
    return styled("{}: {}; {}", status, lead(now), link(now)[1])
