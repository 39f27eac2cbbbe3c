"""What replays of the recording say, in words."""

from __future__ import annotations

from collections.abc import Iterator

from rulec_runtime.report.text import listed, number

from rulec.mismatch.result import Seen, SelfProof

SHOWN = 3
"""Explanations that are told instead of one that are named."""


def power_words(power: SelfProof) -> Iterator[str]:
    """A sentence on replays with nothing missing, then one per concealed effect."""
    yield (
        f"With nothing missing, something would be called missing in {power.called_missing} of "
        f"{power.replays} replays of this recording."
    )
    for seen in power.effects:
        yield f"{seen.title}: {_told(seen, power.replays)}."


def _told(seen: Seen, replays: int) -> str:
    """How often an effect is told, from which size on, and what else is.

    >>> own = Seen(id="a", title="A", size=0.12, unit="bar", told=187, found=True, usual=0.05,
    ...     told_usual=40, seen_from=0.08, other={"B": 3})
    >>> _told(own, 200)[:84]
    'told in 187 of 200 at the size found (0.12 bar), in 40 at its usual size (0.05 bar);'
    >>> _told(own, 200)[85:]
    'seen from about 0.08 bar on; instead of it B was told in 3'
    """
    if not seen.size > 0.0:
        return "no reading of this recording shows it"
    usual = f"{seen.told_usual} {{}}at its usual size ({_amount(seen.usual, seen.unit)})"
    if seen.found:
        found = f"told in {seen.told} of {replays} at the size found"
        parts = [f"{found} ({_amount(seen.size, seen.unit)}), in {usual.format('')}"]
    else:
        parts = [f"told in {usual.format(f'of {replays} ')}"]
    if seen.seen_from is None:
        parts.append("at no size that it may have it is told in half of them")
    else:
        # So many replays tell no more than one digit of it.
        parts.append(f"seen from about {_amount(seen.seen_from, seen.unit, 1)} on")
    other = [f"{title} was told in {count}" for title, count in list(seen.other.items())[:SHOWN]]
    if other:
        parts.append(f"instead of it {listed(other)}")
    return "; ".join(parts)


def _amount(value: float, unit: str, digits: int = 2) -> str:
    return number(value, digits) if unit == "1" else f"{number(value, digits)} {unit}"
