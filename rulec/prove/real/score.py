"""Scores of the tool's answer for a rig, and over all rigs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rulec.language.units import UnitTable
from rulec.prove.judge import interval_of
from rulec.prove.limits import (
    BOOTSTRAP_SAMPLES,
    CERTAIN,
    COVERAGE_OF_DEGREES,
    MENTIONED,
    TAILS,
)
from rulec.prove.real.rig_folder import FalseAlarm, Missing, Rig, Size, Truth

SILENT = "none"
UNNAMED = "unnamed"
Form = Mapping[str, Any]


@dataclass(frozen=True)
class Cause:
    """An id and its places: `module.place`, or the module alone."""

    name: str
    places: tuple[str, ...]


@dataclass(frozen=True)
class ScoredFinding:
    """A finding: the causes it leaves open, its headline first, and its class's probability."""

    causes: tuple[Cause, ...]
    probability: float
    form: Form

    @property
    def headline(self) -> ScoredFinding:
        """The same finding with its first cause only."""
        return replace(self, causes=self.causes[:1])

    @property
    def text(self) -> str:
        """As a table shows it."""
        first, others = self.causes[0], len(self.causes) - 1
        more = f" or {others} more" if others else ""
        return f"{first.name}{more} at {first.places[0]} {100 * self.probability:.0f} %"


@dataclass(frozen=True, kw_only=True)
class Scored:
    """A rig and its scores; None if a score does not apply.

    Attributes
    ----------
    place, headline, named : share of the missing things whose place is reported; whose id is the
        headline of a finding; whose id is in the ambiguity set of a finding
    probability : of the class that contains a right id
    inside : number of intervals of sizes that contain the truth, and of all of right ids
    false : findings that match nothing that is missing
    silent : whether nothing is reported; None if something is missing
    utility : of the ambiguity set, see `utility`
    predicted : by reading, errors of the plants on unseen rows; `signal` is the one that counts
    """

    rig: Rig
    verdict: str
    said: tuple[ScoredFinding, ...]
    place: float | None
    headline: float | None
    named: float | None
    probability: float | None
    inside: tuple[int, int]
    false: tuple[ScoredFinding, ...]
    silent: bool | None
    utility: float | None
    predicted: Mapping[str, Form]
    noise: Mapping[str, float]
    signal: str
    refused: str
    error: str

    @property
    def sure(self) -> tuple[ScoredFinding, ...]:
        """False findings that are reported as certain."""
        return tuple(f for f in self.false if f.probability >= CERTAIN)

    def ratio(self, over: str) -> float | None:
        """Return the error of the adopted plant over that of another model, on `signal`."""
        errors = self.predicted.get(self.signal, {})
        other = self.grey_box if over == "grey box" else errors.get(over)
        return errors["adopted"] / other if other and errors.get("adopted") else None

    @property
    def grey_box(self) -> float | None:
        """Error of a hand-made model, on the signal that counts."""
        return next((g.error for g in self.rig.grey_box if g.signal == self.signal), None)


def scored(rig: Rig, asked: Form) -> Scored:
    """Score the result of `ask` on a rig."""
    form, truth = asked["form"] or {}, rig.truth
    effects = form.get("effects", ())
    said = tuple(scored_finding(effect) for effect in effects if effect["sort"] != "free")
    missing = truth.missing if truth else ()
    verdict = str(form.get("verdict", "no answer"))
    right = [(m, best(m, said)) for m in missing]
    hits = [hit for m, f in right if f and truth for hit in _hits(m, f, truth.units)]
    reported = _reported_places(form)
    # The reading whose prediction counts: that of the rig, or else that of the tool.
    wanted = (rig.signal, (form.get("fit") or {}).get("signal"), *asked["predicted"])
    return Scored(
        rig=rig,
        verdict=verdict,
        said=said,
        place=mean(float(is_at(m, reported)) for m in missing),
        headline=mean(name_right(m, [f.headline for f in said], verdict) for m in missing),
        named=mean(name_right(m, said, verdict) for m in missing),
        probability=mean(f.probability for _, f in right if f),
        inside=(sum(hits), len(hits)),
        false=false_of(truth, said) if truth else (),
        silent=verdict == SILENT if truth and not missing else None,
        utility=utility(missing, said, int(form.get("tried") or 0)) if truth and form else None,
        predicted=asked["predicted"],
        noise={fit["signal"]: fit["heldout"]["noise"] for fit in form.get("fits") or ()},
        signal=next((str(name) for name in wanted if name in asked["predicted"]), ""),
        refused=asked["refused"],
        error=asked["error"],
    )


def scored_finding(effect: Form) -> ScoredFinding:
    """Read a finding with the causes it leaves open: its class, and likely ones if it is unsure.

    Its probability is that together with the findings that coincide with it. An alternative has its
    places in its id, as in `A.cold-line@law(dp, M1.T)`; one without, such as a fault, has those of
    the finding.
    """
    sure = float(effect.get("class_probability") or effect["probability"] or 0.0)
    places = tuple(f"{m}.{effect['place']}" for m in effect["modules"])
    if effect["sort"] == "structure":
        places = tuple(effect["place"].split())
    causes = [Cause(effect["effect"], places)]
    for other in effect["alternatives"]:
        if other.get("same") or (sure < CERTAIN and other["probability"] >= MENTIONED):
            name, at, place = other["id"].partition("@")
            own = f"{name.partition('.')[0]}.{place.partition('(')[0]}"
            causes.append(Cause(other["effect"], (own,) if at else places))
    return ScoredFinding(tuple(dict.fromkeys(causes)), sure, effect)


def is_at(missing: Missing, places: Sequence[str]) -> bool:
    """Return whether one of the places is right; a module alone includes all places in it."""
    return any(p == right or p.startswith(f"{right}.") for p in places for right in missing.places)


def best(missing: Missing, said: Sequence[ScoredFinding]) -> ScoredFinding | None:
    """Return the most probable finding that contains a right id."""

    def is_right(cause: Cause) -> bool:
        return cause.name in missing.names and is_at(missing, cause.places)

    right = (f for f in said if any(map(is_right, f.causes)))
    return max(right, key=lambda f: f.probability, default=None)


def name_right(missing: Missing, said: Sequence[ScoredFinding], verdict: str) -> float:
    """Return 1 if something is named, or reported unnamed where no entry names it, else 0."""
    return float(best(missing, said) is not None if missing.names else verdict == UNNAMED)


def _reported_places(form: Form) -> list[str]:
    """All places in an answer."""
    latent = form.get("hidden_driver")
    parts = [*form.get("locations", ()), *([latent] if latent else [])]
    causes = (c for e in form.get("effects", ()) for c in scored_finding(e).causes)
    return [f"{p['module']}.{p['place']}" for p in parts] + [p for c in causes for p in c.places]


def false_of(truth: Truth, said: Sequence[ScoredFinding]) -> tuple[ScoredFinding, ...]:
    """Return the findings that match nothing."""
    matching = (any(best(m, [f]) for m in truth.missing) for f in said)
    other = [f for f, right in zip(said, matching, strict=True) if not right]
    return tuple(f for f in other if f.causes[0].name not in truth.beside)


def _hits(missing: Missing, found: ScoredFinding, units: UnitTable) -> Iterator[bool]:
    """Whether each interval of a size meets the 95 % interval of the truth."""
    for size in missing.sizes:
        interval = interval_of(found.form, size.parameter, size.parameter == "degree")
        if size.name in ("", found.form["effect"]) and interval:
            low, high, unit = interval
            value, u = _in_unit(size, unit, units)
            half = COVERAGE_OF_DEGREES * u
            yield low - half <= value <= high + half


def _in_unit(size: Size, unit: str, units: UnitTable) -> tuple[float, float]:
    """Value and u in another unit; NaN if its dimension differs."""
    if unit == size.unit:
        return size.value, size.u
    own, other = units.parse(size.unit), units.parse(unit)
    if own.dimension != other.dimension:
        return math.nan, math.nan
    return other.from_si(own.to_si(size.value)), size.u * own.factor / other.factor


def utility(missing: Sequence[Missing], said: Sequence[ScoredFinding], candidates: int) -> float:
    """Return the utility of the ambiguity set, 1 if it is the answer alone.

    It is the mean over all diagnoses that the findings leave open. One of N causes among f
    candidates, n of them false and m missed, has 1 - n (N + 1)/(f (n + 1)) - m (f - N + 1)/(f (m +
    1)). An empty report has about 0.5 if one thing is missing. Ids that are right for the same
    thing are one cause, so there is one true diagnosis. Source: DX competition 2026, synthetic
    track (github.com/jdekleer/dxc26synth, m_utl of ambiguity groups).
    """

    def matched(cause: Cause) -> str:
        """Number of the missing thing that a cause matches, or else its place and id."""
        own = ScoredFinding((cause,), 1.0, {})
        right = (str(i) for i, m in enumerate(missing) if best(m, [own]))
        return next(right, f"{cause.places[0]} {cause.name}")

    true = frozenset(str(number) for number, m in enumerate(missing) if m.names)
    open_ = [[matched(cause) for cause in found.causes] for found in said]
    diagnoses = set(map(frozenset, itertools.product(*open_)))
    f = max(candidates, 1 + max(map(len, (true, *diagnoses))))

    def of(w: frozenset[str]) -> float:
        n, m, size = len(w - true), len(true - w), len(w)
        return 1 - n * (size + 1) / (f * (n + 1)) - m * (f - size + 1) / (f * (m + 1))

    return float(np.mean([of(w) for w in diagnoses]))


def mean(values: Iterable[float]) -> float | None:
    """Return the mean; None of nothing."""
    found = list(values)
    return float(np.mean(found)) if found else None


@dataclass(frozen=True)
class Total:
    """A mean score over the rigs that have it, with its 95 % interval by bootstrap over them; NaN
    below two rigs."""

    title: str
    value: float
    low: float
    high: float
    count: int


def totals(found: Sequence[Scored]) -> list[Total]:
    """Return every score over the rigs that have it; of ratios the geometric mean."""
    judged = [s for s in found if s.rig.truth is not None]
    columns: dict[str, list[float | None]] = {
        "place right": [s.place for s in found],
        "name right, headline": [s.headline for s in found],
        "name right, in its class": [s.named for s in found],
        "probability of the right class": [s.probability for s in found],
        "size inside its interval": [s.inside[0] / s.inside[1] for s in found if s.inside[1]],
        "false names a rig": [float(len(s.false)) for s in judged],
        f"rigs with a wrong name at {CERTAIN:g}": [float(bool(s.sure)) for s in judged],
        "silent where nothing is missing": [s.silent for s in found],
        "utility of the ambiguity set": [s.utility for s in found],
    }
    over = "error on unseen rows over {}".format
    ratios = {over(m): [s.ratio(m) for s in found] for m in ("shipped", "recalibrated", "grey box")}
    rows = []
    for title, values in (*columns.items(), *ratios.items()):
        there = [float(v) for v in values if v is not None]
        if title in ratios:
            there = [math.log(v) for v in there if v]
        low = high = math.nan
        if len(there) > 1:
            drawn = np.random.default_rng(0).choice(there, (BOOTSTRAP_SAMPLES, len(there)))
            low, high = np.quantile(drawn.mean(axis=1), TAILS).tolist()
        if there:
            ends = [float(np.mean(there)), low, high]
            value, low, high = map(math.exp, ends) if title in ratios else ends
            rows.append(Total(title, value, low, high, len(there)))
    return rows


@dataclass(frozen=True)
class Alarm:
    """A false alarm of the manifest, and its probability if it is reported again."""

    stated: FalseAlarm
    again: float | None


def alarms(manifest: Sequence[FalseAlarm], found: Sequence[Scored]) -> list[Alarm]:
    """Return the false alarms of rigs that were judged."""
    headlines = {s.rig.name: [f.headline for f in s.said] for s in found}
    judged = [a for a in manifest if a.rig in headlines]
    again = [best(Missing((a.wrong,), (a.place,)), headlines[a.rig]) for a in judged]
    return [Alarm(a, f.probability if f else None) for a, f in zip(judged, again, strict=True)]
