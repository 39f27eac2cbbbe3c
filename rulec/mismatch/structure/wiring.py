"""Is the plant connected otherwise than its file says? Judged as columns are, and against physics.

Whoever moves a pipe frees nothing: flows balance there, or they do not. A network that leaves less
to be compared pays for what it leaves out as for readings that cannot be. And what a fault, a
sensor or an effect at the same modules explains about as well is none of the plant file's mistakes.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from rulec_runtime.recordings.recording import Recording
from scipy.special import expit

from rulec.knowledge.sources import Sources
from rulec.mismatch import limits as common
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement, Compared
from rulec.mismatch.structure.connections import Rewiring
from rulec.mismatch.structure.hypotheses import CONNECTION, AcceptedHypothesis, Hypothesis


@dataclass(frozen=True)
class Comparable:
    """How many comparisons a settled point allows at most, and `rows`, all points together."""

    each: int
    rows: int


class Wired(Protocol):
    """Settled points of a plant, connected as they are taken to be."""

    @property
    def sources(self) -> Sources | None:
        """Documents of the plant."""

    def agreement(self, recording: Recording, steps: int) -> Agreement:
        """How well a recording agrees with the plain model, refitted in so many steps."""

    def comparable(self, recording: Recording) -> Comparable:
        """What could be compared if everything could be read that is settled."""

    def otherwise(self, recording: Recording) -> tuple[Rewiring, ...]:
        """Other connections that may be, near what contradicts the rest."""

    def rewired(self, rewiring: Rewiring) -> Wired | None:
        """The same plant connected otherwise; None where the compiler refuses it."""

    def explained(
        self, recording: Recording, modules: Sequence[str]
    ) -> list[tuple[Agreement, int]]:
        """How well it agrees with each of the best explanations at some modules, with so many
        unknowns."""


@dataclass(frozen=True)
class _Judged:
    """Other connections, with how far the recording agrees with them better over `rows`."""

    rewiring: Rewiring
    wired: Wired
    rows: int
    compared: Compared


def connection_of(recording: Recording, stated: Wired, columns: int) -> AcceptedHypothesis | None:
    """The connection that is not as stated, if one is; so many `columns` were doubted besides."""
    every = stated.otherwise(recording)
    tried = [(one, wired) for one in every if (wired := stated.rewired(one)) is not None]
    price = limits.STRUCTURE_ODDS - float(np.log(max(len(tried) + columns, 1)))
    promising = _promising(recording, stated, tried)
    sound = [
        one
        for one in _judged(recording, stated, promising, limits.STRUCTURE_STEPS)
        if one.compared.left_strained < limits.STRUCTURE_LEAVES and _sure(one.compared.gain + price)
    ]
    if not sound:
        return None
    first = max(sound, key=lambda one: one.compared.gain)
    gain = _beyond_physics(recording, stated, first)
    if not _sure(gain + price):
        return None
    near = first.compared.gain - float(np.log(common.CERTAIN / (1.0 - common.CERTAIN)))
    alike = [o.rewiring for o in sound if o is not first and o.compared.gain > near]
    hypothesis = hypothesis_of(first.rewiring, alike, stated.sources)
    return AcceptedHypothesis(hypothesis, first.compared.gain, float(expit(gain + price)))


def _sure(odds: float) -> bool:
    return float(expit(odds)) > common.CERTAIN


def _beyond_physics(recording: Recording, stated: Wired, judged: _Judged) -> float:
    """What other connections gain over the best explanation with those stated, nats.

    A fault may be there as well, so each network may have one explanation at the same modules.
    """
    plain, modules = judged.compared.recorded, judged.rewiring.modules
    own = max((0.0, *_gains(plain, stated.explained(recording, modules), plain.rows)))
    there = judged.wired.explained(recording, modules)
    return max((judged.compared.gain, *_gains(plain, there, judged.rows))) - own


def _gains(
    plain: Agreement, explained: Sequence[tuple[Agreement, int]], rows: int
) -> Iterator[float]:
    """What explanations gain, nats, their unknowns paid for (Schwarz 1978)."""
    for there, unknowns in explained:
        paid = 0.5 * unknowns * float(np.log(max(there.count, 1.0)))
        yield Compared(plain, there.over(rows)).gain - paid


def _promising(
    recording: Recording, stated: Wired, tried: Sequence[tuple[Rewiring, Wired]]
) -> list[tuple[Rewiring, Wired]]:
    """Those that gain most without any refit."""
    found = _judged(recording, stated, tried, 0)
    found = sorted((o for o in found if o.compared.each > 0.0), key=lambda o: -o.compared.each)
    return [(o.rewiring, o.wired) for o in found[: limits.STRUCTURE_REFITTED]]


def _judged(
    recording: Recording, stated: Wired, tried: Sequence[tuple[Rewiring, Wired]], steps: int
) -> list[_Judged]:
    """Other connections beside those stated.

    What is settled and cannot be read, and what is not compared any more, is as far off as can be.
    What is compared that was not before is nothing that the stated ones should have foretold.
    """
    own, plain = stated.comparable(recording), stated.agreement(recording, steps)
    every = [(r, w, w.comparable(recording), w.agreement(recording, steps)) for r, w in tried]
    read = [a.rows / c.rows for c, a in ((own, plain), *((c, a) for _, _, c, a in every)) if c.rows]
    most = max(read, default=0.0)
    plain = plain.over(round(most * own.rows))
    found = []
    for rewiring, wired, able, there in every:
        if able.rows and there.rows >= limits.REWIRED_READS * most * able.rows:
            rows = round(most * able.rows * max(own.each / able.each, 1.0))
            found.append(_Judged(rewiring, wired, rows, Compared(plain, there.over(rows))))
    return found


def hypothesis_of(
    rewiring: Rewiring, alike: Sequence[Rewiring], sources: Sources | None
) -> Hypothesis:
    """Another connection in words; `alike` are others that fit as well."""
    fits = _fits(rewiring)
    if alike:
        fits = f"{' or '.join([fits, *map(_fits, alike)])} (they do not tell which)"
    edits = " or ".join(edit_of(one, sources) for one in (rewiring, *alike))
    return Hypothesis(
        kind=CONNECTION,
        rewiring=rewiring,
        text=f"the plant file {_says(rewiring)}; the readings fit {fits}",
        action=f"look at the pipes; if they are so, {edits}",
    )


def _says(rewiring: Rewiring) -> str:
    if rewiring.stated is not None:
        source, target = rewiring.stated
        return f"says {source} feeds {target}"
    assert rewiring.fits is not None
    source, target = rewiring.fits
    return f"does not say that {source} feeds {target}"


def _fits(rewiring: Rewiring) -> str:
    if rewiring.fits is None:
        assert rewiring.stated is not None
        source, target = rewiring.stated
        return f"{source} not feeding {target}"
    source, target = rewiring.fits
    instead = "" if rewiring.stated is None else " instead"
    return f"{source} feeding {target}{instead}"


def edit_of(rewiring: Rewiring, sources: Sources | None) -> str:
    """What to edit, with the file and the line."""
    at = _line(rewiring, sources)
    old, new = (f"'{' -> '.join(p)}'" if p else "" for p in (rewiring.stated, rewiring.fits))
    if not old:
        return f"add {new} to the connections in {at}"
    return f"change {old} to {new} in {at}" if new else f"delete {old} in {at}"


def _line(rewiring: Rewiring, sources: Sources | None) -> str:
    """Where the connection stands, or where one is to be added."""
    document = None if sources is None else sources.plant
    if sources is None or document is None:
        return "plant.yaml"
    if sources.adjacency is not None:
        return str(sources.adjacency[0])
    listed = [str(text) for text in document.data.get("connections", ())]
    text = " -> ".join(rewiring.stated) if rewiring.stated is not None else ""
    path = ("connections", listed.index(text)) if text in listed else ("connections",)
    place = document.place(*path)
    return f"{place.file}, line {place.line}"
