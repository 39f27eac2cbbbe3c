"""Comparisons as they may come out, one of each verdict, and an experiment, made by hand."""

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from rulec.mismatch.experiment.result import Experiment, Reading, Step
from rulec.mismatch.result import (
    UNWRITTEN,
    Alternative,
    CandidateSet,
    Changed,
    Confounded,
    Curves,
    Errors,
    Estimate,
    Evidence,
    Finding,
    Fit,
    LatentInput,
    Location,
    Mismatch,
    Period,
    Region,
    Repair,
    Rival,
)

NAN = float("nan")


def curves(samples: int = 400, shape: float = 1.0) -> Curves:
    """A flow that falls with the liquid's temperature, which the plain model does not know."""
    time = np.arange(samples, dtype=float)
    warm = 35.0 + 20.0 * np.sin(np.pi * time / samples) ** 2
    pressure = 1.5 + 0.5 * np.sign(np.sin(time / 9.0))
    plain = 520.0 - 20.0 * pressure
    lost = shape * 0.8 * np.maximum(warm - 45.0, 0.0)
    noise = np.random.default_rng(7).normal(0.0, 0.9, samples)
    return Curves(
        time=time,
        measured=plain - lost + noise,
        shipped=plain + 3.0,
        recalibrated=plain - lost.mean(),
        repaired=plain - lost,
        heldout=(time // 40) % 4 == 3,
        drivers={"A.T [degC]": warm, "A.dp [bar]": pressure},
        inside=np.ones(samples, dtype=bool),
    )


WARM = Finding(
    id="A.warm-gap@Q_gap",
    sort="physics",
    name="warm-gap",
    title="Gap flow that follows the temperature",
    module="A",
    place="Q_gap",
    parameters={
        "b": Estimate("rise of the gap flow per kelvin", 0.0231, 0.0011, 0.0209, 0.0253, "1/K"),
        "T0": Estimate("temperature of the plain law", 45.2, 0.0, 45.2, 45.2, "degC"),
    },
    equation="Q_gap = law(dp=0) - (law(dp=0) - law)*exp(b*(T - T0))",
    text="Module A: the gap flow grows by 0.0231 1/K with A.T; the law knows only the pressure",
    action="add the liquid's temperature to the law",
    source="[assumed]",
    probability=0.93,
    alternatives=(
        Alternative("A.age@Q_gap", "age", "Gap flow that grows with time", 0.05),
        Alternative("A.odd@Q_gap", "odd", "Nothing of importance", 0.002),
    ),
    gain=412.3,
    rivals=(
        Rival("nothing (recalibration alone)", 0.0),
        Rival("as many parameters without physics", 3.1),
        Rival("the same with its driver shuffled", -1.4),
    ),
    periods=(),
    closed=0.98,
)

PLACE = Location(
    module="A",
    place="Q_gap",
    title="gap flow of the dosing pump",
    share=0.83,
    region=(Region("A.T", 45.0, None, "degC", 0.97),),
    periods=(),
)


def errors(points: int, *sizes: float) -> Errors:
    """As shipped, recalibrated, repaired, and noise."""
    shipped, recalibrated, repaired, noise = sizes
    return Errors(
        shipped=shipped, recalibrated=recalibrated, repaired=repaired, noise=noise, points=points
    )


FIT = Fit(
    signal="A.Q",
    unit="l/h",
    estimation=errors(300, 6.1, 4.2, 0.91, 0.9),
    heldout=errors(100, 6.4, 4.4, 0.93, 0.9),
    gain_interval=(0.71, 0.85),
    closed=0.97,
)

OTHER = Fit(
    signal="A.dp",
    unit="bar",
    estimation=errors(300, 0.09, 0.07, 0.021, 0.02),
    heldout=errors(100, 0.08, 0.06, 0.022, 0.02),
    gain_interval=(0.5, 0.7),
    closed=0.99,
)

NAMED = Mismatch(
    plant="abc",
    title="Two dosing modules feed one mixer",
    recording="warm.csv",
    verdict="named",
    headline="In A the gap flow follows its temperature; the model knows only the pressure.",
    locations=(PLACE,),
    findings=(WARM,),
    fit=FIT,
    fits=(FIT, OTHER),
    confounded=(Confounded("A.b", "A.C2", -0.93),),
    latent_input=None,
    untested=("A.T above 55 degC: no held-out point",),
    next="Run A at two pressures with warm liquid: it separates b from C2.",
    split="blocks of 40 s: 6 to search, 2 to choose, 2 held out",
    digest="9f2c01d3",
    noise="noise from the scatter of the recording, 0.9 l/h, within the sensors' class",
    tried=37,
    notes=("warm.csv: 3 samples are not settled",),
    repair=Repair(
        joined=("A.warm-gap@Q_gap",),
        parameters=(
            Changed("A.C2", 5.6e-17, 1e-18),
            Changed("A.warm-gap@Q_gap.b", 0.0231, 0.0011),
        ),
        covariance=np.array([[1e-36, -9e-22], [-9e-22, 1.2e-6]]),
        fixed={"A.warm-gap@Q_gap.T0": 318.35},
        misfit={"A.pump": 2.5e-7},
        ranges={},
    ),
    curves=curves(),
    seconds=4.31,
    evidence=(
        Evidence(300, True, "for search and fit"),
        Evidence(100, True, "held out"),
        Evidence(19, False, "A.n is below 60 rpm"),
        Evidence(8, False, "not settled"),
    ),
)

AMBIGUOUS = replace(
    NAMED,
    verdict="ambiguous",
    headline="In A the gap flow changes; temperature and time explain it about equally well.",
    findings=(
        replace(
            WARM,
            probability=0.52,
            alternatives=(replace(WARM.alternatives[0], probability=0.45),),
        ),
    ),
    locations=(replace(PLACE, also=("A.P_law", "A.loss")),),
)

FAULT = replace(
    NAMED,
    verdict="fault",
    headline="The model fits; A leaks in two periods.",
    findings=(
        replace(
            WARM,
            id="A.lost@pump",
            sort="fault",
            name="lost",
            title="Flow lost",
            place="pump",
            parameters={},
            equation="",
            text="A: a share of the flow is lost",
            action="inspect the pump",
            alternatives=(),
            periods=tuple(
                Period(40.0 * i, 40.0 * i + 25.0, 0.05 * (i + 1), 0.004) for i in range(6)
            ),
        ),
    ),
    locations=(replace(PLACE, region=(), periods=((0.0, 25.0), (200.0, 225.0))),),
    repair=replace(NAMED.repair, joined=()),
    confounded=(),
)

SENSOR = replace(
    FAULT,
    verdict="sensor",
    headline="A.dp reads high by 0.12 bar.",
    findings=(
        replace(
            WARM,
            sort="sensor",
            name="shift",
            title="Reading shifted",
            place="dp",
            parameters={"d": Estimate("shift", 0.12, 0.004, 0.112, 0.128, "bar")},
            equation="",
            text="A.dp reads high by 0.12 bar",
            action="compare the sensor with a second one",
        ),
    ),
)

UNNAMED = replace(
    NAMED,
    verdict="unnamed",
    headline="The gap flow of A changes, and nothing known explains how.",
    findings=(),
    repair=replace(NAMED.repair, joined=()),
    latent_input=LatentInput(
        module="A",
        place="Q_gap",
        text="slow: warms up within 3 min, returns after stops",
        time=np.arange(0.0, 400.0, 5.0),
        course=np.where(np.arange(80) == 7, NAN, 8.0 * np.sin(np.pi * np.arange(80) / 80) ** 2),
        unit="l/h",
        candidates=("the liquid's temperature", "the level of the tank"),
        sensor="a thermometer at the inlet of A",
    ),
    next="Fit a thermometer at the inlet of A and record an hour.",
)

PLAIN = replace(
    FIT,
    estimation=errors(300, 1.4, 0.92, NAN, 0.9),
    heldout=errors(100, 1.5, 0.91, NAN, 0.9),
    gain_interval=(NAN, NAN),
    closed=NAN,
)

NONE = replace(
    NAMED,
    verdict="none",
    headline="Recalibrated, the model meets the recording to within the noise.",
    locations=(),
    findings=(),
    fit=PLAIN,
    fits=(PLAIN,),
    confounded=(),
    untested=(),
    next="",
    repair=replace(NAMED.repair, joined=()),
)

CANNOT_JUDGE = replace(
    NONE,
    verdict="cannot judge",
    headline="The recording has no settled stretch of 3 samples or more.",
    fit=None,
    fits=(),
    curves=None,
    repair=UNWRITTEN,
    next="Record at least three samples at each operating point.",
    tried=0,
    seconds=0.02,
)

VERDICTS = (NAMED, AMBIGUOUS, FAULT, SENSOR, UNNAMED, NONE, CANNOT_JUDGE)
ALL = {mismatch.verdict: mismatch for mismatch in VERDICTS}


def spoken(text: str) -> Mismatch:
    """One that says the same everywhere: in titles, places, units, drivers and notes."""
    finding = replace(
        WARM,
        **dict.fromkeys(("name", "title", "module", "place", "text", "action", "source"), text),
        equation=text,
        parameters={text: replace(WARM.parameters["b"], title=text, unit=text)},
        alternatives=tuple(replace(a, title=text) for a in WARM.alternatives),
        rivals=tuple(replace(r, title=text) for r in WARM.rivals),
        periods=FAULT.findings[0].periods,
    )
    return replace(
        NAMED,
        **dict.fromkeys(("plant", "title", "recording", "headline", "next", "noise"), text),
        **dict.fromkeys(("split", "digest"), text),
        **dict.fromkeys(("notes", "untested"), (text,)),
        findings=(finding,),
        fit=replace(NAMED.fit, signal=text, unit=text),
        locations=(replace(PLACE, title=text, also=(text,)),),
        latent_input=replace(UNNAMED.latent_input, module=text, text=text, unit=text, sensor=text),
        curves=replace(curves(), drivers={text: curves().time}),
    )


def broken(mismatch: Mismatch) -> Mismatch:
    """The same verdict with no number known, as a comparison that went badly may leave it."""
    matrix = np.full_like(mismatch.repair.covariance, NAN)
    return replace(_unknown(mismatch), repair=replace(mismatch.repair, covariance=matrix))


NO_NUMBERS: dict[str, Any] = {"upper": float("inf"), "points": 0, "signal": ""}
"""What a field of this name holds where nothing is known; in others numbers are NaN."""


def _unknown(of: Any) -> Any:
    """A part of a comparison without its numbers; what was measured, and when, is known."""
    if isinstance(of, float):
        return NAN
    if isinstance(of, tuple):
        return tuple(map(_unknown, of))
    if isinstance(of, dict):
        return {name: _unknown(part) for name, part in of.items()}
    if isinstance(of, np.ndarray):
        return of if of.dtype == bool else np.full(len(of), NAN)
    if not is_dataclass(of):
        return of
    names = {f.name for f in fields(of)}
    names -= {"time", "measured", "repair"} if "time" in names else {"repair"}
    changed = {name: NO_NUMBERS.get(name, _unknown(getattr(of, name))) for name in names}
    return replace(of, **changed)  # type: ignore[type-var]


def made_by_hand() -> Experiment:
    """Two explanations; a reading that is predicted in the first of two steps, one in both."""
    rest: Any = {"joined": (), "values": {}, "fixed": {}, "periods": (), "terms": ()}
    one = CandidateSet(names=(), titles=("One",), probability=0.5, **rest)
    seen = (
        Reading("A.dp", (1e5, 2e5), 9.0, (1e3, 1e3)),
        Reading("C.dp", (1e5, 1e5), 0.0, (1.0, 1.0)),
    )
    steps = tuple(
        Step(15.0 * place, 15.0 * (place + 1), {"A.n": 10.0}, {}, readings)
        for place, readings in enumerate((seen, seen[1:]))
    )
    return Experiment(
        standing=(one, replace(one, titles=("Two",))),
        left_out=(),
        steps=steps,
        certainty=(0.5, 0.9, 0.9),
        unlisted=0.0,
        factors=np.zeros((2, 2)),
        set_by={"A.n": (5.0, 10.0)},
        present={"A.n": 5.0},
        limited=False,
        hindering=(),
        unwatched=(),
        time_is_short=False,
        sensors=(),
        sample=1.0,
    )
