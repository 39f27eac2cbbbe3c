"""The answer: the verdict in one word, one sentence, and the next step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rulec_runtime.report.text import listed, percent

from rulec.effects.candidate import TIME, Missing
from rulec.knowledge.parameter_belief import Strain
from rulec.mismatch import limits
from rulec.mismatch.answer.wording import onset, region_words, titled
from rulec.mismatch.result import CandidateSet, Finding, Fit, LatentInput, Location
from rulec.mismatch.structure.hypotheses import CONNECTION

TO_RECORD = "Record settled operation with all readings that the observers need."

NOT_YET = "Do not adopt this as it is"

EXPERIMENT = "Plan a recording that separates them: `rulec experiment` reads the file of `--json`."

MEANWHILE = " Until then, `rulec adopt` writes it as a curve."

PLAIN = "The recalibrated plant can be written with `rulec adopt --recalibrated`."


def with_misread(
    verdict: str, headline: str, then: str, misread: Sequence[Finding]
) -> tuple[str, str, str]:
    """Verdict, headline and next step, which first say what columns and connections are not as
    stated."""
    if not misread:
        return verdict, headline, then
    found, todo = (
        " ".join(f"{text[0].upper()}{text[1:]}." for text in texts)
        for texts in ([f.text for f in misread], [f.action for f in misread])
    )
    alone = verdict == "none"
    pipes = [f for f in misread if f.name == CONNECTION]
    so = ["read"] * (len(pipes) < len(misread)) + ["connected"] * bool(pipes)
    # Nothing can be adopted before the plant file is right.
    rest = "" if alone or pipes else f" {then}"
    return (
        ("named" if pipes else "sensor") if alone else verdict,
        f"{found} {' and '.join(so).capitalize()} as it should be, {_inside(headline)}",
        f"{todo} Then run again.{rest}",
    )


@dataclass(frozen=True)
class Doubt:
    """What speaks against the verdict that nothing is missing.

    `nothing` is the probability that nothing is missing. `beyond` are the readings whose errors
    exceed what noise, sensors and laws explain, with the error as a share of the reading. `strain`
    are parameters that would have to lie far from their data sheets.
    """

    nothing: float
    beyond: tuple[tuple[Fit, float], ...]
    strain: tuple[Strain, ...]

    @property
    def is_there(self) -> bool:
        """Is there any doubt?"""
        return self.nothing < limits.CERTAIN or bool(self.beyond) or bool(self.unbelievable)

    @property
    def unbelievable(self) -> tuple[Strain, ...]:
        """Parameters with values that are not credible."""
        return tuple(s for s in self.strain if not s.is_believable)


def verdict_of(findings: Sequence[Finding], left: bool, doubt: Doubt) -> str:
    """One of the verdicts of docs/repair-a-model.md; `left`: some of the mismatch has no name."""
    named = [f for f in findings if f.sort != "free"]
    if left and sum(f.closed for f in named) < limits.MAJOR:
        return "unnamed"
    if not named:
        if left or findings:
            return "unnamed"
        return "unsure" if doubt.is_there else "none"
    physics = [f for f in named if f.sort in OF_THE_MODEL]
    deciding = physics or named
    if deciding[0].class_probability < limits.CERTAIN:
        return "ambiguous"
    if physics:
        return "named"
    return "fault" if named[0].sort == "fault" else "sensor"


def headline_of(
    verdict: str,
    findings: Sequence[Finding],
    locations: Sequence[Location],
    doubt: Doubt,
    fits: Sequence[Fit] = (),
    standing: Sequence[CandidateSet] = (),
) -> str:
    """The answer in one sentence; `standing` are the possible sets, most probable first, but for
    those that the probability of nothing includes."""
    named = [f for f in findings if f.sort != "free"]
    if verdict == "none":
        return _nothing(fits)
    if verdict == "unsure":
        return _unsure(doubt, standing)
    if verdict == "unnamed":
        return _unnamed(named, locations)
    sure = [f for f in named if f.class_probability >= limits.CERTAIN]
    if verdict == "ambiguous":
        # Physics decides before faults and sensors.
        first = next((f for f in named if f.sort in OF_THE_MODEL), named[0])
        several = any(a.probability >= limits.MENTIONED for a in first.alternatives)
        lead = "Not decided" if several else "Not sure enough to be named"
        text = f"{lead}: {_named(first, odds=True)}."
        return text + (f" Certain: {listed(list(map(_named, sure)))}." if sure else "")
    parts = [
        f"{lead} {listed(own)}"
        for sorts, lead in sorted(LEADS.items(), key=lambda entry: verdict not in entry[0])
        if (own := [_named(f) for f in sure if f.sort in sorts])
    ]
    if verdict in ("fault", "sensor"):
        lead = parts[0].replace(LEADS["sensor",], "A sensor is not:")
        parts[0] = f"The model is right; {_inside(lead)}"
    open_ = [_named(f) for f in named if f not in sure]
    parts += [f"not sure: {listed(open_)}"] if open_ else []
    return "; ".join([parts[0], *map(_inside, parts[1:])]) + "."


OF_THE_MODEL = ("physics", "ageing")
"""Sorts of effects that a model may leave out; these decide before faults and sensors."""

LEADS = {
    OF_THE_MODEL: "The model lacks",
    ("fault",): "The plant has a fault:",
    ("sensor",): "A sensor is wrong:",
}
"""How a headline introduces explanations of each sort."""


def _unnamed(named: Sequence[Finding], locations: Sequence[Location]) -> str:
    places = {(f.module, f.place) for f in named}
    unnamed = [at for at in locations if (at.module, at.place) not in places]
    most = max(unnamed or locations, key=lambda at: at.share, default=None)
    where = f"{most.module}.{most.place}" if most else "the plant"
    shape = most.shape if most else None
    follows = f" It depends on {shape.driver}." if shape and shape.driver != TIME else ""
    return (
        f"Something is missing at {where} that no known effect, fault or sensor error explains."
        f"{follows}"
    )


def _named(finding: Finding, odds: bool = False) -> str:
    """A finding with its module, and all alternatives of similar probability, each once."""
    name = _inside(titled(finding))
    grown = next((p for p in finding.periods if p.growth), None)
    if grown is not None:
        name += f" that grows since {onset(grown)}"
    every = {name: finding.probability}
    for other in finding.alternatives:
        if other.same or other.probability >= limits.MENTIONED:
            title = _inside(other.title)
            every[title] = every.get(title, 0.0) + other.probability
    if finding.shapeless >= limits.MENTIONED:
        every["a curve like it"] = finding.shapeless
    return " or ".join(f"{n} ({percent(p)})" if odds else n for n, p in every.items())


def _inside(text: str) -> str:
    """A text inside a sentence, in lower case unless it begins with a reading, such as B.Q.

    >>> _inside("Lost inflow"), _inside("B.Q reads low")
    ('lost inflow', 'B.Q reads low')
    """
    return text if "." in text.split()[0] else f"{text[0].lower()}{text[1:]}"


def remainder_of(
    verdict: str, fits: Sequence[Fit], strain: Sequence[Strain] = (), written: bool = True
) -> str:
    """How far off the repaired model still is, and its values that are not credible; else empty.

    A named explanation may be incomplete or wrong, which must be known before the repair is
    adopted. If nothing of it is `written`, the errors are those of the explanation.
    """
    if verdict in ("none", "unsure", "cannot judge"):
        return ""
    most, signal = _farthest(fits, written)
    far = most >= limits.FAR_OFF and verdict != "unnamed"
    but = [f"{signal} is still off by {most:.0f} times its noise"] * far
    if strain:
        but.append(f"far from the sheet: {'; '.join(map(str, strain))}")
    return f" However, {'; '.join(but)}." if but else ""


def _unsure(doubt: Doubt, standing: Sequence[CandidateSet]) -> str:
    off = "; ".join(f"{fit.signal} is off by {percent(share)}" for fit, share in doubt.beyond)
    strained = "; ".join(map(str, doubt.unbelievable))
    text = f"Perhaps nothing is missing ({percent(doubt.nothing)})."
    if off or strained or doubt.nothing < limits.MENTIONED:
        why = off or strained or f"only {percent(doubt.nothing)} that nothing is missing"
        text = f"Something is missing, but this recording does not say what: {why}."
    if likely := _likely(standing):
        titles = [f"{_inside(' and '.join(s.titles))} ({percent(s.probability)})" for s in likely]
        return f"{text} Possible explanations: {'; '.join(titles)}."
    if strained and (likely := _likely([s for s in standing if s.titles])):
        titles = [_inside(" and ".join(s.titles)) for s in likely]
        return f"{text} If the sheet is right: perhaps {' or '.join(titles)}."
    return text


def _likely(standing: Sequence[CandidateSet]) -> list[CandidateSet]:
    """Explanations of a share of the total probability that is worth mentioning."""
    least = limits.MENTIONED * sum(s.probability for s in standing)
    return [s for s in standing if s.titles and s.probability >= least]


def _nothing(fits: Sequence[Fit]) -> str:
    """No explanation is probable; an inexact law may nevertheless be far off."""
    most, signal = _farthest(fits)
    if most < limits.FAR_OFF:
        return (
            "The model is complete: recalibrated, it agrees with the recording within noise and "
            "the accuracy of its laws."
        )
    return (
        f"Nothing is known to be missing: {signal} is off by {most:.0f} times its noise, which is "
        "within the accuracy of its law."
    )


def _farthest(fits: Sequence[Fit], written: bool = True) -> tuple[float, str]:
    """The largest error of the repaired model, or of an explanation that is not written, in units
    of the noise, and its signal."""
    every = [(f.heldout.repaired if written else f.heldout.explained, f) for f in fits]
    far = [(off / f.heldout.noise, f.signal) for off, f in every if f.heldout.noise > 0]
    return max((own for own in far if own[0] >= 0.0), default=(0.0, ""))


def next_step(
    verdict: str,
    findings: Sequence[Finding],
    latent: LatentInput | None,
    missing: Sequence[Missing],
    refused: str = "",
    locations: Sequence[Location] = (),
    standing: Sequence[CandidateSet] = (),
    curves: bool = False,
    unwritable: str = "",
) -> str:
    """What to do next: adopt, act, or measure; `refused` says why nothing should be adopted,
    `curves` that a plant can hold what has no name, `unwritable` why it holds nothing of what has
    one."""
    if latent is not None and latent.switches:
        return (
            f"Look at what happens at {latent.module}.{latent.place} where it changes. Go to the "
            "same set points from below and from above, and run again."
        )
    if latent is not None:
        sensor = latent.sensor or "what may drive it"
        return f"Record {sensor} together with the rest, and run again."
    if verdict == "none":
        return "Nothing to do."
    if verdict == "unsure":
        check = "Check the data sheets, and record other operating points."
        return f"{EXPERIMENT if _likely(standing) else check} {NOT_YET}."
    if verdict == "cannot judge":
        return TO_RECORD
    first = next((f for f in findings if f.sort != "free"), None)
    if verdict == "ambiguous":
        apart = "Record a part in which the drivers of these explanations vary independently, or"
        plan = f"{EXPERIMENT} Or" if len(standing) > 1 else apart
        return f"{plan} add a sensor that only one of them depends on."
    if verdict == "named" and unwritable and first is not None:
        act = f"{first.action[0].upper()}{first.action[1:]}"
        return f"{act}. `rulec adopt` cannot write it: {unwritable}. {PLAIN}"
    if verdict == "named":
        adopt = "Write the repaired module types with `rulec adopt`, and diagnose with them."
        return f"{NOT_YET}: {refused}. {PLAIN}" if refused else adopt
    shaped = [at for at in locations if at.shape is not None and at.shape.driver != TIME]
    if verdict == "unnamed" and shaped:
        return _look_at(shaped[0]) + (MEANWHILE if curves and not refused else "")
    if first is not None:
        return first.action
    if missing:
        return f"Record {missing[0].sensor}: {missing[0].title} would then be judged."
    return "Vary the operating point at this place, and compare once more."


def _look_at(location: Location) -> str:
    """What to inspect and what to run if the driver of the missing term is known."""
    shape, place = location.shape, f"{location.module}.{location.place}"
    assert shape is not None
    look = f"Look at what changes at {place} with {shape.driver}."
    for region in location.region:
        if region.variable == shape.driver:
            when = region_words(replace(region, share=float("nan")))
            when = when.replace(shape.driver, f"{shape.driver} is", 1)
            look = f"Look at what happens at {place} while {when}."
    run = (
        f" Run {shape.driver} slowly up and down through its range: that shows whether there is "
        "hysteresis."
    )
    law = " If you know the law, write it as an effect and run again."
    return look + (run if shape.memory != "no" else "") + law
