"""Diagnosis of a plant that stores: its balances fitted to a moving window of the recording.

windows -> usual misfit -> judge -> spells -> findings. The result types are those of a plant that
settles, so reports, plots and files are the same.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.degree import degree_in_words
from rulec_runtime.contract.ruleset import Dynamics, Ruleset
from rulec_runtime.diagnosis.steady.findings import Finding, Found, Period
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.evidence import evidence_of, latest_of
from rulec_runtime.diagnosis.stores.free_balances import with_free_states
from rulec_runtime.diagnosis.stores.joined_windows import Cause, Spell, spells_of
from rulec_runtime.diagnosis.stores.judge_windows import Judged
from rulec_runtime.diagnosis.stores.misfit import Weighed, weighed
from rulec_runtime.diagnosis.stores.window_fit import Model
from rulec_runtime.diagnosis.stores.windows import NO_READING, Windows, windows_of
from rulec_runtime.recordings.plant_calendar import BRIEFLY_GONE, ENDED, TO_THE_END, UNJUDGED
from rulec_runtime.recordings.recording import Recording


@dataclass(frozen=True, kw_only=True)
class StoresJudged:
    """Judgement of a recording of a plant that stores; `covered` flags its judged samples."""

    judged: tuple[Judged, ...]
    found: Found
    notes: tuple[str, ...]
    covered: np.ndarray


def judge_stores(recording: Recording, ruleset: Ruleset) -> StoresJudged:
    """Judge a recording of a plant that stores."""
    windows = windows_of(recording, ruleset)
    found = weighed(ruleset, windows)
    spells = spells_of(found.judged, ruleset.fault_by_id)
    blind = _not_judged(windows, found.judged, found.judge.model.dynamics.outputs)
    result = Found([], [], blind, latest_of(found.judge, found.judged))
    for place, spell in enumerate(spells):
        (since, until), cause = _times(found.judged, spell), spell.cause
        if spell.brief:
            if not _beside_another(spells, place):
                what = f"{cause.fault} would fit" if cause else "the balances do not fit"
                text = f"{what}, but a finding takes {limits.WINDOWS_IN_A_ROW} windows in a row"
                result.not_judged.append(Period(since, until, text))
        elif cause is None:
            result.unknown.append(Period(since, until, _unknown(found, spell)))
        else:
            result.findings.append(_finding(ruleset, windows, found, spells, spell, cause))
    covered = np.zeros(len(recording), dtype=bool)
    for one in found.judged:
        if one.plain is not None:
            begin, end = one.window.time[[0, -1]]
            covered |= (recording.time >= begin) & (recording.time <= end)
    notes = tuple(_notes(ruleset, windows, found))
    return StoresJudged(judged=found.judged, found=result, notes=notes, covered=covered)


def _times(judged: Sequence[Judged], spell: Spell) -> tuple[float, float]:
    first, last = judged[spell.first].window, judged[spell.last - 1].window
    return float(first.time[0]), float(last.time[-1])


def _beside_another(spells: Sequence[Spell], place: int) -> bool:
    """Whether it is the edge of a spell that is reported anyway."""
    own = spells[place]
    return any(
        not other.brief and other.first <= own.last and own.first <= other.last for other in spells
    )


def _unknown(found: Weighed, spell: Spell) -> str:
    """The reading that the balances miss most."""
    outputs = found.judge.model.dynamics.outputs
    off = np.zeros(len(outputs))
    for i in spell.members:
        plain = found.judged[i].plain
        if plain is not None:
            off += np.nan_to_num((plain.error / found.judge.model.spread) ** 2).sum(axis=0)
    what = f"{outputs[int(np.argmax(off))]} moves in a way that the balances explain with no known"
    return f"nothing known fits: {what} fault"


def _finding(
    ruleset: Ruleset,
    windows: Windows,
    found: Weighed,
    spells: Sequence[Spell],
    spell: Spell,
    cause: Cause,
) -> Finding:
    fault, judged, model = ruleset.fault_by_id[cause.fault], found.judged, found.judge.model
    since, until = _times(judged, spell)
    before = _sound(judged, range(spell.first - 1, -1, -1), spell.first, fault.id)
    behind = _sound(judged, range(spell.last, len(judged)), spell.last - 1, fault.id)
    inside = spell.inside
    if before is not None:
        since = _edge(model, windows, before, judged[inside[0]], fault.id, cause.degree)
    if behind is not None:
        until = _edge(model, windows, behind, judged[inside[-1]], fault.id, cause.degree)
    strongest = max(inside, key=lambda i: judged[i].plain.chi if judged[i].plain else 0.0)  # type: ignore[union-attr]
    return Finding(
        fault,
        cause.degree,
        max(cause.lower, fault.lowest),
        min(cause.upper, fault.highest),
        cause.probability,
        since,
        until,
        cause.rivals,
        cause.remote,
        (),
        evidence_of(model, windows, judged, spell, cause),
        _readings(model.dynamics, judged[strongest]),
        (),
        judged[strongest].known.windows,
        fault.text.replace("{degree}", degree_in_words(fault, cause.degree)),
        _behind(windows, judged, spells, spell, fault.id, until),
    )


def _edge(
    model: Model, windows: Windows, sound: Judged, faulty: Judged, fault: str, degree: float
) -> float:
    """The time between a sound window and a faulty one at which a fault of a degree begins.

    If the faulty one comes first, it is the time at which the fault ends.
    """
    begins = sound.window.first < faulty.window.first
    one, other = (sound, faulty) if begins else (faulty, sound)
    window = windows.joined(one.window, other.window)
    assert one.plain is not None
    moved = replace(model, balances=with_free_states(model.dynamics, (f"x.{fault}",)))
    guess = replace(one.plain.guess, degrees=np.zeros(0))
    places = np.unique(np.linspace(0, len(window.time) - 1, limits.EDGE_PLACES).astype(int))
    best, when = np.inf, float(window.time[0])
    for place in places.tolist():
        later = np.arange(len(window.time)) >= place
        course = np.where(later == begins, degree, 0.0)
        own = replace(window, inputs=np.column_stack([window.inputs, course]))
        found = moved.fit(own, sound.known, guess)
        if found is not None and found.chi < best:
            best, when, guess = found.chi, float(window.time[place]), found.guess
    return when


def _behind(
    windows: Windows,
    judged: Sequence[Judged],
    spells: Sequence[Spell],
    spell: Spell,
    fault: str,
    until: float,
) -> str | None:
    """What follows a spell: as many windows without the fault as a finding needs; the end; or a
    part that could not be judged."""
    # Deviating windows may hold a part of the fault, unless something else is reported for them.
    other = {i for one in spells if not one.brief for i in one.members}
    behind = [i for i in range(spell.last, len(judged)) if judged[i].lacks(fault)]
    gone = sum(not judged[i].deviating or i in other for i in behind)
    if gone >= limits.WINDOWS_IN_A_ROW:
        return ENDED
    last = max(float(piece.time[-1]) for piece in windows.pieces)
    if until >= last:
        return TO_THE_END
    return BRIEFLY_GONE if behind else UNJUDGED


def _sound(
    judged: Sequence[Judged], places: Iterable[int], beside: int, fault: str
) -> Judged | None:
    """The nearest window of the same piece that would show a fault but does not, if only brief
    deviations are in between."""
    for i in places:
        one = judged[i]
        if one.window.piece != judged[beside].window.piece or one.plain is None:
            return None
        if not one.deviating:
            return one if fault in one.floor else None
        if abs(i - beside) > limits.WINDOWS_IN_A_ROW:
            return None
    return None


def _readings(dynamics: Dynamics, one: Judged) -> tuple[tuple[str, float], ...]:
    names = (*dynamics.inputs, *dynamics.outputs)
    table = np.column_stack([one.window.inputs, one.window.measured])
    return tuple(
        (n, float(np.nanmedian(c)))
        for n, c in zip(names, table.T, strict=True)
        if np.isfinite(c).any()
    )


def _not_judged(windows: Windows, judged: Sequence[Judged], outputs: Sequence[str]) -> list[Period]:
    """Windows that could not be judged, neighbours with the same reason joined."""
    found: list[Period] = []
    last = -2
    there = np.any([np.isfinite(p.measured).any(axis=0) for p in windows.pieces], axis=0)
    for i, one in enumerate(judged):
        because = one.window.because
        if one.plain is None:
            because = because or "the balances have no solution here"
        else:
            known = np.isfinite(one.window.measured).mean(axis=0) >= limits.WINDOW_KNOWN
            blind = [n for n, t, k in zip(outputs, there, known, strict=True) if t and not k]
            because = f"in part: {NO_READING.format(' and '.join(blind))}" if blind else ""
        if not because:
            continue
        since, until = float(one.window.time[0]), float(one.window.time[-1])
        if found and last == i - 1 and found[-1].text == because:
            found[-1] = replace(found[-1], until=until)
        else:
            found.append(Period(since, until, because, partly=one.plain is not None))
        last = i
    text = (
        f"fewer than {limits.FEWEST_IN_WINDOW} samples without a pause: "
        "balances need a window to be followed in"
    )
    return found + [Period(since, until, text) for since, until in windows.too_short]


def _notes(ruleset: Ruleset, windows: Windows, found: Weighed) -> list[str]:
    notes = []
    if windows.thinned > 1:
        notes.append(f"{windows.thinned} samples at a time were averaged")
    for i, name in enumerate(found.judge.model.dynamics.outputs):
        measured = any(np.isfinite(p.measured[:, i]).any() for p in windows.pieces)
        if measured and found.misfit[i] > limits.REMARKABLE_MISFIT * windows.noise[i]:
            signal = ruleset.signal_by_id[name]
            usual, noise = (x[i] / signal.factor for x in (found.misfit, windows.noise))
            slow = 1.0 / found.judge.share[i]
            lasts = f", alike for about {slow:.0f} samples" if slow > 1.0 else ""
            notes.append(
                f"{name}: the balances usually miss this reading by {usual:.2g} {signal.unit}"
                f"{lasts} (its noise is {noise:.2g}); only what goes beyond counts"
            )
    return notes
