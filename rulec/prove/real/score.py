"""Scores of the tool's answer for a rig, and over all rigs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
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
    sure : the false findings with a probability of CERTAIN and more
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
    said = tuple(
        scored_finding(effect) for effect in form.get("effects", ()) if effect["sort"] != "free"
    )
    missing = truth.missing if truth else ()
    verdict = str(form.get("verdict", "no answer"))
    noise = {fit["signal"]: fit["heldout"]["noise"] for fit in form.get("fits") or ()}
    right = [_best(m, said) for m in missing]
    # The reading whose prediction counts: that of the rig, or else that of the tool.
    wanted = (rig.signal, (form.get("fit") or {}).get("signal"), *asked["predicted"])
    return Scored(
        rig=rig,
        verdict=verdict,
        said=said,
        place=_mean(_place_right(m, form) for m in missing),
        headline=_mean(_name_right(m, [f.headline for f in said], verdict) for m in missing),
        named=_mean(_name_right(m, said, verdict) for m in missing),
        probability=_mean(found.probability for found in right if found),
        inside=_inside(truth, right),
        false=_false(truth, said),
        silent=verdict == SILENT if truth and not missing else None,
        utility=utility(missing, said, int(form.get("tried") or 0)) if truth and form else None,
        predicted=asked["predicted"],
        noise=noise,
        signal=next((str(name) for name in wanted if name in asked["predicted"]), ""),
        refused=asked["refused"],
        error=asked["error"],
    )


def class_probability(effect: Form) -> float:
    """Return the probability of a finding together with those that coincide with it."""
    return float(effect.get("class_probability") or effect["probability"] or 0.0)


def scored_finding(effect: Form) -> ScoredFinding:
    """Read a finding with the causes it leaves open: its class, and likely ones if it is unsure."""
    sure = class_probability(effect)
    others = (
        a
        for a in effect["alternatives"]
        if a.get("same") or (sure < CERTAIN and a["probability"] >= MENTIONED)
    )
    places = tuple(f"{m}.{effect['place']}" for m in effect["modules"])
    if effect["sort"] == "structure":
        places = tuple(effect["place"].split())
    more = dict.fromkeys(Cause(a["effect"], _places_of(a["id"], places)) for a in others)
    own = Cause(effect["effect"], places)
    return ScoredFinding((own, *(c for c in more if c != own)), sure, effect)


def _places_of(id_: str, usual: tuple[str, ...]) -> tuple[str, ...]:
    """Places of an alternative, by its id as in `A.cold-line@law(dp, M1.T)`.

    One without a place, such as a fault, has the places of the finding.

    >>> _places_of("A.cold-line@law(dp, M1.T)", ()), _places_of("A.leakage", ("A.Q",))
    (('A.law',), ('A.Q',))
    """
    name, at, place = id_.partition("@")
    return (f"{name.partition('.')[0]}.{place.partition('(')[0]}",) if at else usual


def _at(missing: Missing, places: Sequence[str]) -> bool:
    """Whether one of the places is right; a module alone includes all places in it."""
    return any(p == right or p.startswith(f"{right}.") for p in places for right in missing.places)


def _is(missing: Missing, found: ScoredFinding) -> bool:
    return any(c.name in missing.names and _at(missing, c.places) for c in found.causes)


def _best(missing: Missing, said: Sequence[ScoredFinding]) -> ScoredFinding | None:
    """The most probable finding that contains a right id."""
    return max((f for f in said if _is(missing, f)), key=lambda f: f.probability, default=None)


def _name_right(missing: Missing, said: Sequence[ScoredFinding], verdict: str) -> float:
    if not missing.names:
        return float(verdict == UNNAMED)
    return float(_best(missing, said) is not None)


def _place_right(missing: Missing, form: Form) -> float:
    found = [f"{p['module']}.{p['place']}" for p in form.get("locations", ())]
    found += [
        p for e in form.get("effects", ()) for c in scored_finding(e).causes for p in c.places
    ]
    hidden = form.get("hidden_driver")
    return float(
        _at(missing, [*found, f"{hidden['module']}.{hidden['place']}"] if hidden else found)
    )


def _false(truth: Truth | None, said: Sequence[ScoredFinding]) -> tuple[ScoredFinding, ...]:
    """Findings that match nothing; empty if nothing is known of the rig."""
    if truth is None:
        return ()
    beside = set(truth.beside)
    return tuple(
        f
        for f in said
        if not any(_is(m, f) for m in truth.missing) and f.causes[0].name not in beside
    )


def _inside(truth: Truth | None, right: Sequence[ScoredFinding | None]) -> tuple[int, int]:
    """Number of intervals of sizes that meet the 95 % interval of the truth, and of all."""
    if truth is None:
        return 0, 0
    pairs = [(m, f) for m, f in zip(truth.missing, right, strict=True) if f]
    hits = [hit for m, f in pairs for hit in _hits(m, f, truth.units)]
    return sum(hits), len(hits)


def _hits(missing: Missing, found: ScoredFinding, units: UnitTable) -> Iterator[bool]:
    for size in missing.sizes:
        interval = interval_of(found.form, size.parameter, size.parameter == "degree")
        if size.name in ("", found.form["effect"]) and interval:
            low, high, unit = interval
            value, u = _in_unit(size, unit, units)
            reach = COVERAGE_OF_DEGREES * u
            yield low - reach <= value <= high + reach


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
        right = (i for i, m in enumerate(missing) if cause.name in m.names and _at(m, cause.places))
        number = next(right, None)
        return f"{cause.places[0]} {cause.name}" if number is None else str(number)

    true = frozenset(str(number) for number, m in enumerate(missing) if m.names)
    open_ = [[matched(cause) for cause in found.causes] for found in said]
    diagnoses = set(map(frozenset, itertools.product(*open_)))
    f = max(candidates, 1 + max(map(len, (true, *diagnoses))))

    def of(w: frozenset[str]) -> float:
        n, m, size = len(w - true), len(true - w), len(w)
        return 1 - n * (size + 1) / (f * (n + 1)) - m * (f - size + 1) / (f * (m + 1))

    return float(np.mean([of(w) for w in diagnoses]))


def _mean(values: Iterator[float] | Any) -> float | None:
    found = list(values)
    return float(np.mean(found)) if found else None


@dataclass(frozen=True)
class Total:
    """A mean score over the rigs that have it, with its 95 % interval by bootstrap over them."""

    title: str
    value: float
    low: float
    high: float
    count: int


def totals(found: Sequence[Scored]) -> list[Total]:
    """Return every score over the rigs that have it."""
    known = [s for s in found if s.rig.truth is not None]
    columns: list[tuple[str, Sequence[float | None]]] = [
        ("place right", [s.place for s in found]),
        ("name right, headline", [s.headline for s in found]),
        ("name right, in its class", [s.named for s in found]),
        ("probability of the right class", [s.probability for s in found]),
        (
            "size inside its interval",
            [s.inside[0] / s.inside[1] if s.inside[1] else None for s in found],
        ),
        ("false names a rig", [float(len(s.false)) for s in known]),
        (f"rigs with a wrong name at {CERTAIN:g}", [float(bool(s.sure)) for s in known]),
        ("silent where nothing is missing", [s.silent for s in found]),
        ("utility of the ambiguity set", [s.utility for s in found]),
    ]
    rows = [_total(title, values, exponent=False) for title, values in columns]
    for over in ("shipped", "recalibrated", "grey box"):
        logs = [math.log(r) if (r := s.ratio(over)) else None for s in found]
        rows.append(_total(f"error on unseen rows over {over}", logs, exponent=True))
    return [row for row in rows if row.count]


def _total(title: str, values: Sequence[float | None], *, exponent: bool) -> Total:
    there = [float(v) for v in values if v is not None]
    if not there:
        return Total(title, math.nan, math.nan, math.nan, 0)
    ends = (float(np.mean(there)), *_bootstrap(there))
    value, low, high = map(math.exp, ends) if exponent else ends
    return Total(title, value, low, high, len(there))


def _bootstrap(values: Sequence[float]) -> tuple[float, float]:
    """95 % interval of a mean; NaN below two values."""
    if len(values) < 2:
        return math.nan, math.nan
    drawn = np.random.default_rng(0).choice(values, (BOOTSTRAP_SAMPLES, len(values)))
    low, high = np.quantile(drawn.mean(axis=1), TAILS)
    return float(low), float(high)


@dataclass(frozen=True)
class Alarm:
    """A false alarm of the manifest, and its probability if it is reported again."""

    known: FalseAlarm
    again: float | None


def alarms(manifest: Sequence[FalseAlarm], found: Sequence[Scored]) -> list[Alarm]:
    """Return the false alarms of rigs that were judged."""
    headlines = {s.rig.name: [f.headline for f in s.said] for s in found}
    known = [a for a in manifest if a.rig in headlines]
    again = [_best(Missing((a.wrong,), (a.place,)), headlines[a.rig]) for a in known]
    return [Alarm(a, f.probability if f else None) for a, f in zip(known, again, strict=True)]
