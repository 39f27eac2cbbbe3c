"""The answer as a story: its parts in order, alike on the terminal and on the page."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.report.parts import Content, Facts, Part, Table, Words
from rulec_runtime.report.text import counted, fixed, listed, number, percent

from rulec.effects.candidate import TIME
from rulec.mismatch import limits
from rulec.mismatch.answer.wording import (
    VERDICTS,
    degree_words,
    hysteresis,
    interval,
    is_repaired,
    letter,
    periods_words,
    region_words,
    rounded,
    share,
    suffix,
    text_plot,
    titled,
)
from rulec.mismatch.result import (
    Detectability,
    Evidence,
    Finding,
    Fit,
    LatentInput,
    Location,
    Mismatch,
    SelfProof,
)
from rulec.mismatch.structure.hypotheses import CONNECTION

SORTS = {
    "physics": "physics missing from the model",
    "ageing": "a change with time or age",
    "fault": "a fault of the plant",
    "sensor": "an error of a sensor",
    "structure": "an error of the table, neither of the plant nor of a sensor",
    CONNECTION: "an error of the plant file, neither of the plant nor of a sensor",
    "free": "a dependence without a name in the catalogue",
}

MOST = 3
"""Most items of a kind in the brief story; JSON has all."""

Fact = tuple[str, Sequence[str]]
"""A term with its lines."""


def story(mismatch: Mismatch, brief: bool) -> list[Part]:
    """All parts that are not empty, those with a letter first on a page; in brief the main items,
    with curves drawn in characters."""
    own = letter(mismatch)
    parts = [*_findings(mismatch, brief)]
    if mismatch.latent_input is not None:
        facts = Facts([*_latent(mismatch.latent_input, brief)])
        parts.append(Part("What drives it is not recorded", [facts], own))
    parts.append(Part("Recordings", _facts(_recordings(mismatch))))
    if mismatch.fit is not None:
        parts.append(_proof(mismatch, mismatch.fit, brief))
    parts.append(_numbers(mismatch, brief))
    parts.append(Part("Next", [Words(mismatch.next)] if mismatch.next else [], own))
    if mismatch.power is not None:
        power = [*map(Words, power_words(mismatch.power))]
        parts.append(Part("What this recording can show", power))
    return [part for part in parts if part.content]


def _facts(facts: Iterable[Fact], style: str = "facts") -> list[Content]:
    """Terms that have lines, if there are any."""
    rows = [fact for fact in facts if fact[1]]
    return [Facts(rows, style)] if rows else []


def _some(lines: Sequence[str], brief: bool, noun: str, joined: str = "and ") -> list[str]:
    """The first lines, and the number of those left out; `joined` comes before it."""
    left = len(lines) - MOST if brief else 0
    if left <= 0:
        return list(lines)
    return [*lines[:MOST], f"{joined}{counted(left, f'other {noun}')} (--json has all)"]


def _findings(mismatch: Mismatch, brief: bool) -> Iterator[Part]:
    """Each finding with its place, then places without a finding."""
    locations = list(mismatch.locations)
    findings = mismatch.findings[:MOST] if brief else mismatch.findings
    for finding in findings:
        columns = finding.sort == "structure"
        name = finding.place if columns else f"{finding.module}.{finding.place}"
        here = [p for p in locations if f"{p.module}.{p.place}" in name.split()]
        # Two findings may share a place; places are in the order of findings.
        here = here if columns else here[:1]
        facts = [fact for at in here for fact in _facts_at(at, brief)]
        locations = [at for at in locations if at not in here]
        facts += finding_facts(finding, brief)
        title = f"{finding.text[:1].upper()}{finding.text[1:]}"
        yield Part(title, _facts(facts, ""), letter(mismatch))
    if len(findings) < len(mismatch.findings):
        left = counted(len(mismatch.findings) - MOST, "other finding")
        yield Part("Others", [Words(f"and {left} (--json has all)")])
        return
    facts = [fact for at in locations[: MOST if brief else None] for fact in _facts_at(at, brief)]
    if brief and len(locations) > MOST:
        facts.append(("", [f"and {counted(len(locations) - MOST, 'other place')}"]))
    yield Part("Where the mismatch sits", _facts(facts, ""), letter(mismatch))


def finding_facts(finding: Finding, brief: bool = False) -> Iterator[Fact]:
    """How certain a finding is, its alternatives, when it occurred, and what to do."""
    sort = SORTS.get(finding.name if finding.name == CONNECTION else finding.sort, finding.sort)
    yield "probability", [f"{share(finding.probability)}, {sort}"]
    ordered = sorted(finding.alternatives, key=lambda a: -a.probability)
    others = [
        f"{a.title} ({share(a.probability)})" for a in ordered if a.probability >= limits.PLAUSIBLE
    ]
    if finding.inexact >= limits.PLAUSIBLE:
        # First, as it is the reason why the finding is uncertain.
        others.insert(0, f"inaccuracy of the laws and sensors ({share(finding.inexact)})")
    if others:
        yield "could also be", [listed(_some(others, brief, "explanation", joined=""))]
    if finding.periods:
        yield "when", list(degree_words(finding.periods))
    if finding.action:
        yield "do", [finding.action]


def _facts_at(location: Location, brief: bool) -> Iterator[Fact]:
    """A place with its share of the mismatch, its region and periods, and its shape."""
    name = f"{location.module}.{location.place}"
    place = name if location.title in ("", name) else f"{location.title} ({name})"
    if np.isfinite(location.share):
        place += f": {share(location.share)} of the mismatch"
    lines = [place]
    if location.region:
        lines.append("; ".join(region_words(region) for region in location.region))
    if location.periods:
        lines.append(periods_words(location.periods))
    if location.also:
        lines.append(f"indistinguishable here from {listed(location.also)}")
    yield "where", lines
    shape = location.shape
    if shape is None:
        return
    # A course in time has a drawing of its own.
    units = (shape.driver_unit, shape.unit)
    drawn = brief and shape.driver != TIME
    rows = text_plot(shape.at, shape.value, shape.u, units) if drawn else []
    yield "shape", [f"over {shape.driver} {shape.text}", *rows]
    yield "hysteresis", [hysteresis(shape)]
    for beaten in shape.beaten[:MOST]:
        words = f"{beaten.title}: fits worse by {number(beaten.nats, 2)} in log likelihood"
        if beaten.region is not None:
            region = region_words(replace(beaten.region, share=float("nan")))
            words += f", {share(beaten.region.share)} of that at {region}"
        yield "not", [words]


def _latent(latent: LatentInput, brief: bool) -> Iterator[Fact]:
    finite = np.isfinite(latent.course)
    rows: list[str] = []
    if brief and finite.any():
        course = latent.course[finite]
        rows = text_plot(latent.time[finite], course, 0.0 * course, ("s", latent.unit))
    yield "course", [latent.text, *rows]
    if latent.candidates:
        yield "could be", [listed(latent.candidates)]
    if latent.sensor:
        yield "sensor", [latent.sensor]


def _recordings(mismatch: Mismatch) -> Iterator[Fact]:
    for part in mismatch.recordings:
        likely = "; ".join(f"{likely.title} {percent(likely.probability)}" for likely in part.alone)
        used = f"{fixed(part.used, 0)} of {counted(part.rows, 'row')} used"
        alone = VERDICTS[part.verdict][1] + (f" ({likely})" if likely else "")
        yield part.name, [f"{used}; alone: {alone}"]
    if mismatch.changed:
        yield "changed", [update.text for update in mismatch.changed]


def _proof(mismatch: Mismatch, fit: Fit, brief: bool) -> Part:
    repaired, why = is_repaired(mismatch), mismatch.unproven
    rows = _errors(fit, repaired)
    others = [f for f in mismatch.fits if f != fit]
    facts = []
    for other in others[: MOST if brief else None]:
        held = ", ".join(f"{number(held)} {name}" for name, _, held in _errors(other, repaired))
        facts.append(("also", [f"{other.signal} {held}{suffix(other.unit)}"]))
    rivals = [_rivals_words(f) for f in mismatch.findings[: MOST if brief else None] if f.rivals]
    refused = f"Not proven: {why}, so rulec adopt will refuse. " if why else ""
    texts = [refused + _heldout_words(fit, repaired), explained_words(mismatch)]
    title = f"{'Error' if why else 'Proof: error'} of {fit.signal} ({fit.unit}, rms)"
    title += ", not yet proven" if why else ""
    cells = [(name, number(fitted), number(held)) for name, fitted, held in rows]
    errors = Table(("", ".fitted", ".held out"), cells, broken=("",))
    words = [Words(text) for text in texts if text]
    return Part(title, [errors, *words, *_facts([*facts, ("rivals", rivals)])])


def _errors(fit: Fit, repaired: bool) -> list[tuple[str, float, float]]:
    """Name and error of each model on estimation and held-out blocks, in the unit of the signal."""
    names = {"shipped": "as shipped", "recalibrated": "recalibrated", "repaired": "repaired"}
    return [
        (words, getattr(fit.estimation, name), getattr(fit.heldout, name))
        for name, words in {**names, "noise": "estimated noise"}.items()
        if repaired or name != "repaired"
    ]


def _heldout_words(fit: Fit, repaired: bool) -> str:
    held = fit.heldout
    if not repaired:
        were = "was" if held.points == 1 else "were"
        return f"{counted(held.points, 'point')} {were} held out and played no part in the search."
    points = counted(held.points, "held-out point")
    fall = 1 - held.repaired / held.recalibrated if held.recalibrated > 0 else np.nan
    if not np.isfinite(fall):
        return f"The error on {points} could not be compared."
    low, high = fit.gain_interval
    way = "falls" if fall >= 0 else "rises"
    words = f"On {points} the error {way} by {share(abs(fall))} against recalibration"
    if np.isfinite(low) and np.isfinite(high):
        words += f" (95\u00a0%: {share(low)} to {share(high)})"
    if np.isfinite(fit.closed):
        words += f"; {share(fit.closed)} of the explainable mismatch is closed"
    if held.repaired < held.noise:
        words += "; what remains is within the noise"
    return words + "."


def explained_words(mismatch: Mismatch) -> str:
    """The error with the whole explanation, if a model cannot hold all of it and it is smaller;
    else empty."""
    fit, left = mismatch.fit, {name for name, _ in mismatch.left_out}
    if fit is None or not left:
        return ""
    held = fit.heldout
    if not held.explained < (held.repaired if is_repaired(mismatch) else held.recalibrated):
        return ""
    titles = [titled(f) for f in mismatch.findings if f.id in left]
    what = f" ({listed(titles)})" if titles else ""
    explained = number(fit.heldout.explained) + suffix(fit.unit)
    return (
        "The errors above are those of the plant that `rulec adopt` would write. With what a plant "
        f"model cannot hold{what}, the error falls to {explained}."
    )


def _rivals_words(finding: Finding) -> str:
    finite = [r for r in finding.rivals if np.isfinite(r.gain)]
    free = finding.sort == "free"
    title = "What has no name" if free else titled(finding)
    words = f"{title}: gains {number(finding.gain)} in log likelihood"
    if not finite:
        return f"{words}."
    best = max(finite, key=lambda r: r.gain)
    if free:
        return f"{words}; the best known effect gains {number(best.gain)} ({best.title})."
    rivals = f"of {len(finite)} rivals" if len(finite) > 1 else "rival"
    return f"{words}; strongest {rivals}: {best.title} ({number(best.gain, 2)})."


def _numbers(mismatch: Mismatch, brief: bool) -> Part:
    most = MOST if brief else None
    findings = [f for f in mismatch.findings[:most] if f.sort != "free"]
    rows = [
        (
            f"{f.module}: {name}{f', {e.title}' if e.title else ''}",
            *rounded(e.value, e.u),
            interval(e),
            "" if e.unit == "1" else e.unit,
        )
        for f in findings
        for name, e in f.parameters.items()
    ]
    confounded = [
        f"{pair.first} and {pair.second} (correlation {number(pair.correlation, 2)})"
        for pair in mismatch.confounded
    ]
    doubts: dict[str, Sequence[str]] = {
        "equation": [f"{f.module}: {f.equation}" for f in findings if f.equation],
        "strained": list(map(str, mismatch.strain[:most])),
        "confounded": confounded[:most],
        "untested": mismatch.untested[:most],
    }
    if every := mismatch.evidence:
        used, of = [e for e in every if e.used], sum(e.rows for e in every)
        rows_used = f"{fixed(sum(e.rows for e in used), 0)} of {counted(of, 'row')} used"
        why = f": {'; '.join(_counts(used, brief, ' '))}" if used else ""
        doubts["rows"] = [rows_used + why]
        doubts["not used"] = _counts([e for e in every if not e.used], brief, ": ")
    titles = ("parameter", ".value", ".u", "95 % interval", "unit")
    shown = [Table(titles, rows, broken=("parameter",))] if rows else []
    return Part("Numbers", [*shown, *_facts((*doubts.items(), *_origin(mismatch, brief)))])


def _counts(parts: Sequence[Evidence], brief: bool, between: str) -> list[str]:
    """Rows with what they were used for or why not; of many the first, the rest as one."""
    shown = parts[:MOST] if brief else parts
    lines = [f"{fixed(e.rows, 0)}{between}{e.because}" for e in shown]
    rest = sum(e.rows for e in parts[len(shown) :])
    return [*lines, f"{fixed(rest, 0)}{between}others (see --json)"] if rest else lines


def _origin(mismatch: Mismatch, brief: bool) -> Iterator[Fact]:
    if mismatch.split:
        yield "blocks", [mismatch.split] if brief else [mismatch.split, mismatch.digest]
    if not brief:
        tried = f"{counted(mismatch.tried, 'candidate')} in {number(mismatch.seconds, 2)} s"
        sources = dict.fromkeys(f"{f.name}: {f.source}" for f in mismatch.findings if f.source)
        yield from (("noise", [mismatch.noise]), ("tried", [tried]), ("sources", list(sources)))
    yield "notes", _some(list(dict.fromkeys(mismatch.notes)), brief, "note")


def power_words(power: SelfProof) -> Iterator[str]:
    """A sentence on replays with nothing missing, then one per concealed effect."""
    yield (
        f"With nothing missing, something would be reported missing in {power.called_missing} of "
        f"{power.replays} replays of this recording."
    )
    for effect in power.effects:
        yield f"{effect.title}: {_replayed(effect, power.replays)}."


def _replayed(effect: Detectability, replays: int) -> str:
    """How often an effect is found, from which size on, and what is found instead.

    >>> own = Detectability(id="a", title="A", size=0.12, unit="bar", told=187, found=True,
    ...     usual=0.05, told_usual=40, seen_from=0.08, other={"B": 3})
    >>> _replayed(own, 200)[:84]
    'identified in 187 of 200 at the size found (0.12 bar), in 40 at its usual size (0.05'
    >>> _replayed(own, 200)[91:]
    'visible above about 0.08 bar; B was named instead in 3'
    """
    if not effect.size > 0.0:
        return "no reading of this recording shows it"

    def amount(value: float, digits: int = 2) -> str:
        return number(value, digits) + suffix(effect.unit)

    usual = f"at its usual size ({amount(effect.usual)})"
    parts = [f"identified in {effect.told_usual} of {replays} {usual}"]
    if effect.found:
        found = (
            f"identified in {effect.told} of {replays} at the size found ({amount(effect.size)})"
        )
        parts = [f"{found}, in {effect.told_usual} {usual}"]
    if effect.seen_from is None:
        parts.append("at no credible size identified in half of them")
    else:
        # The number of replays allows one digit.
        parts.append(f"visible above about {amount(effect.seen_from, 1)}")
    other = [
        f"{title} was named instead in {count}"
        for title, count in list(effect.other.items())[:MOST]
    ]
    return "; ".join([*parts, *([listed(other)] if other else [])])
