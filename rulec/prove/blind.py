"""A blind test on a user's plant: every effect of the catalogue is concealed in their recording.

The plant's own model replays the recording with its noise, the classes of its sensors and the
accuracies of its laws: with nothing missing, and with each effect in turn at its usual size. What
would `rulec mismatch` report? The answer holds for this plant and this recording only.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.document import Head, document
from rulec_runtime.report.parts import Part, Table, Words, shown
from rulec_runtime.report.text import counted, number

from rulec.commands.mismatch import mismatch
from rulec.effects.model_builder import open_builder
from rulec.mismatch.answer.json_form import power_form
from rulec.mismatch.result import Detectability, SelfProof

OFTEN, SOMETIMES = 0.9, 0.1
"""Least shares of the replays for an effect to count as reported, and as reported at times."""

COLUMNS = ("effect", ".usual size", ".found", ".found from", "named instead")

MEANING = (
    "found: in how many replays it is named with a probability of 0.9 or more, alone or with those "
    "that predict the same here; found from: the size at which half of the replays find it; named "
    "instead: what other replays name. The model of this plant makes the replays, so physics that "
    "it lacks is not in them."
)

NEVER = "{} would not be found at any size that it may have."


@dataclass(frozen=True)
class Blind:
    """The result of the replays for each effect."""

    plant: str
    recording: str
    proof: SelfProof

    @property
    def reported(self) -> list[Detectability]:
        """Effects that are reported at some size, the surest at their usual size first."""
        least = SOMETIMES * self.proof.replays
        shown = (e for e in self.proof.effects if e.seen_from is not None or e.told_usual >= least)
        return sorted((e for e in shown if e.usual > 0.0), key=lambda e: (-e.told_usual, e.id))

    @property
    def unseen(self) -> list[str]:
        """Titles of effects that are not reported at any size."""
        there = {e.id for e in self.reported}
        return [title_of(e) for e in self.proof.effects if e.id not in there]

    @property
    def headline(self) -> str:
        """The result in one sentence."""
        least, count = OFTEN * self.proof.replays, len(self.proof.effects)
        often = sum(e.told_usual >= least for e in self.reported)
        return (
            f"This recording would show {often} of {counted(count, 'effect')} at their usual size; "
            f"where nothing is missing, something would be named in {self.proof.called_missing} of "
            f"{self.proof.replays} replays"
        )

    def form(self) -> dict[str, Any]:
        """Return the machine form; each size has its unit beside it."""
        return {"plant": self.plant, "recording": self.recording, **power_form(self.proof)}


def blind(plant: Path, recording: str, progress: Callable[[str], None]) -> Blind:
    """Conceal every effect that a plant may have in replays of a recording.

    Raises what `rulec.mismatch` raises if it refuses the plant or the recording.
    """
    _, builder = open_builder(plant)
    ids = list(dict.fromkeys(c.id for c in builder.candidates))
    found = mismatch(plant, recording, power=ids, progress=progress).found
    proof = found.power or SelfProof(replays=0, called_missing=0, effects=())
    return Blind(found.plant, found.recording, proof)


def title_of(effect: Detectability) -> str:
    """Return the title of an effect, with its place.

    >>> title_of(Detectability(id="B.slip@Q_geo", title="Slip in B"))
    'Slip in B, at Q_geo'
    """
    place = effect.id.partition("@")[2]
    return f"{effect.title}, at {place}" if place else effect.title


def table(found: Blind) -> Table:
    """Return a row per effect that is reported at some size."""
    rows = []
    for effect in found.reported:
        unit = "" if effect.unit == "1" else f" {effect.unit}"
        least = "no size" if effect.seen_from is None else f"{number(effect.seen_from, 1)}{unit}"
        instead = ", ".join(f"{title} ({count})" for title, count in list(effect.other.items())[:2])
        often = f"{effect.told_usual} of {found.proof.replays}"
        rows.append((title_of(effect), f"{number(effect.usual, 2)}{unit}", often, least, instead))
    return Table(COLUMNS, rows)


def show(out: Console, found: Blind) -> None:
    """Print the result, then the tables."""
    out.print(styled("[bold]{}[/]", found.headline))
    out.print(shown(table(found)))
    count = len(found.unseen)
    if count:
        out.print(styled("\n[bold]{}[/]", NEVER.format(counted(count, "effect"))), end=" ")
        out.print("--report and --json list them.")
    out.print(styled("\n[dim]{}[/]", MEANING))


def page(found: Blind, made: str = "") -> str:
    """Write the page; the same result gives the same text."""
    parts = [Part("What would be found", [table(found)])]
    if found.unseen:
        never = NEVER.format(counted(len(found.unseen), "effect"))
        parts.append(Part(never, [Words(f"{'; '.join(found.unseen)}.")]))
    head = Head(
        kind="Blind test of a recording",
        verdict=found.headline,
        meaning=MEANING,
        facts=(("Plant", found.plant), ("Recording", found.recording)),
        made=made,
    )
    return document(head, parts)
