"""Are the connections other than in the plant file? Judged like columns, and against physics.

A moved pipe has no free parameter: flows balance there, or they do not. A network with fewer
comparisons pays for the missing ones as for impossible readings. And if a fault, a sensor or an
effect at the same modules explains the readings about as well, the plant file is not at fault.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.recordings.recording import Recording
from scipy.special import expit

from rulec.knowledge.sources import Sources
from rulec.mismatch import limits as common
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Compared
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
    prior = limits.STRUCTURE_ODDS - float(np.log(max(len(tried) + columns, 1)))
    gaining = [o for o in _judged(recording, stated, tried, 0) if o.compared.each > 0.0]
    gaining.sort(key=lambda one: -one.compared.each)
    promising = [(o.rewiring, o.wired) for o in gaining[: limits.STRUCTURE_REFITTED]]
    sure = float(np.log(common.CERTAIN / (1.0 - common.CERTAIN)))
    sound = [
        one
        for one in _judged(recording, stated, promising, limits.STRUCTURE_STEPS)
        if one.compared.left_strained < limits.STRUCTURE_LEAVES and one.compared.gain + prior > sure
    ]
    if not sound:
        return None
    first = max(sound, key=lambda one: one.compared.gain)
    gain = _beyond_physics(recording, stated, first) + prior
    if gain <= sure:
        return None
    near = first.compared.gain - sure
    alike = [o.rewiring for o in sound if o is not first and o.compared.gain > near]
    hypothesis = hypothesis_of(first.rewiring, alike, stated.builder.sources)
    return AcceptedHypothesis(hypothesis, first.compared.gain, float(expit(gain)))


def _beyond_physics(recording: Recording, stated: Settled, judged: _Judged) -> float:
    """Gain of other connections over the best explanation with the stated ones, nats, each minus
    the penalty of its unknowns (Schwarz 1978). A fault may be present as well, so each network may
    have one explanation at the same modules."""
    plain, modules = judged.compared.recorded, judged.rewiring.modules

    def best(network: Settled, rows: int, alone: float) -> float:
        gains = (
            Compared(plain, there.over(rows)).gain
            - 0.5 * unknowns * float(np.log(max(there.count, 1.0)))
            for there, unknowns in network.explained(recording, modules)
        )
        return max((alone, *gains))

    return best(judged.wired, judged.rows, judged.compared.gain) - best(stated, plain.rows, 0.0)


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
    every = (rewiring, *alike)
    fits = " or ".join(map(_fits, every)) + " (they do not tell which)" * bool(alike)
    source, target = rewiring.stated or rewiring.fits or ("", "")
    says = "says" if rewiring.stated is not None else "does not say that"
    return Hypothesis(
        kind=CONNECTION,
        rewiring=rewiring,
        text=f"the plant file {says} {source} feeds {target}; the readings fit {fits}",
        action="look at the pipes; if they are so, "
        + " or ".join(_edit_of(one, sources) for one in every),
    )


def _fits(rewiring: Rewiring) -> str:
    source, target = rewiring.fits or rewiring.stated or ("", "")
    if rewiring.fits is None:
        return f"{source} not feeding {target}"
    return f"{source} feeding {target}{'' if rewiring.stated is None else ' instead'}"


def _edit_of(rewiring: Rewiring, sources: Sources | None) -> str:
    """What to edit, with file and line."""
    old, new = (f"'{' -> '.join(p)}'" if p else "" for p in (rewiring.stated, rewiring.fits))
    at = "plant.yaml"
    if sources is not None and sources.plant is not None:
        listed = [f"'{text}'" for text in sources.plant.data.get("connections", ())]
        path = ("connections", listed.index(old)) if old in listed else ("connections",)
        place = sources.plant.place(*path)
        at = f"{place.file}, line {place.line}"
        if sources.adjacency is not None:
            at = str(sources.adjacency[0])
    if not old:
        return f"add {new} to the connections in {at}"
    return f"change {old} to {new} in {at}" if new else f"delete {old} in {at}"
