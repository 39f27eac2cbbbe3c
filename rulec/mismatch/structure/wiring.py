"""Are the connections other than in the plant file? Judged like columns, and against physics.

A moved pipe has no free parameter: flows balance there, or they do not. A network with fewer
comparisons pays for the missing ones as for impossible readings. And if a fault, a sensor or an
effect at the same modules explains the readings about as well, the plant file is not at fault.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.recordings.recording import Recording
from scipy.special import expit

from rulec.knowledge.sources import Sources
from rulec.mismatch import limits as common
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement, Compared
from rulec.mismatch.structure.hypotheses import CONNECTION, AcceptedHypothesis, Hypothesis, Rewiring
from rulec.mismatch.structure.settled import Settled


@dataclass(frozen=True)
class _Judged:
    """Other connections, and how much better the recording agrees with them over `rows`."""

    rewiring: Rewiring
    wired: Settled
    rows: int
    compared: Compared


def connection_of(recording: Recording, stated: Settled, columns: int) -> AcceptedHypothesis | None:
    """The wrong connection, if any; `columns` hypotheses on columns were tried besides."""
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
    hypothesis = hypothesis_of(first.rewiring, alike, stated.builder.sources)
    return AcceptedHypothesis(hypothesis, first.compared.gain, float(expit(gain + price)))


def _sure(odds: float) -> bool:
    return float(expit(odds)) > common.CERTAIN


def _beyond_physics(recording: Recording, stated: Settled, judged: _Judged) -> float:
    """Gain of other connections over the best explanation with the stated ones, nats. A fault may
    be present as well, so each network may have one explanation at the same modules."""
    plain, modules = judged.compared.recorded, judged.rewiring.modules
    own = max((0.0, *_gains(plain, stated.explained(recording, modules), plain.rows)))
    there = judged.wired.explained(recording, modules)
    return max((judged.compared.gain, *_gains(plain, there, judged.rows))) - own


def _gains(
    plain: Agreement, explained: Sequence[tuple[Agreement, int]], rows: int
) -> Iterator[float]:
    """Gains of explanations, nats, minus the price of their unknowns (Schwarz 1978)."""
    for there, unknowns in explained:
        paid = 0.5 * unknowns * float(np.log(max(there.count, 1.0)))
        yield Compared(plain, there.over(rows)).gain - paid


def _promising(
    recording: Recording, stated: Settled, tried: Sequence[tuple[Rewiring, Settled]]
) -> list[tuple[Rewiring, Settled]]:
    found = _judged(recording, stated, tried, 0)
    found = sorted((o for o in found if o.compared.each > 0.0), key=lambda o: -o.compared.each)
    return [(o.rewiring, o.wired) for o in found[: limits.STRUCTURE_REFITTED]]


def _judged(
    recording: Recording, stated: Settled, tried: Sequence[tuple[Rewiring, Settled]], steps: int
) -> list[_Judged]:
    """Other connections compared with those stated. Settled readings that cannot be used and lost
    comparisons count as far off; new ones do not count against the stated connections."""
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
    """What to edit, with file and line."""
    at = _line(rewiring, sources)
    old, new = (f"'{' -> '.join(p)}'" if p else "" for p in (rewiring.stated, rewiring.fits))
    if not old:
        return f"add {new} to the connections in {at}"
    return f"change {old} to {new} in {at}" if new else f"delete {old} in {at}"


def _line(rewiring: Rewiring, sources: Sources | None) -> str:
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
