"""The answer in one word and one sentence, for every kind of finding."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from rulec.effects.candidate import CurveTerm, Missing
from rulec.knowledge.parameter_belief import Strain
from rulec.mismatch.answer.findings import sentence
from rulec.mismatch.answer.verdict import Doubt, headline_of, next_step, remainder_of, verdict_of
from rulec.mismatch.answer.written_plant import refusal
from rulec.mismatch.result import (
    Alternative,
    CandidateSet,
    Check,
    Errors,
    Estimate,
    Finding,
    Fit,
    Location,
)
from tests.runtime.mismatches import UNNAMED, WARM

SURE = replace(WARM, probability=0.95)
UNSURE = replace(WARM, probability=0.5, alternatives=(Alternative("x", "x", "Another one", 0.5),))
FAULT = replace(SURE, sort="fault", title="Flow lost")
SENSOR = replace(SURE, sort="sensor", title="Reading shifted")
AGEING = replace(SURE, sort="ageing", title="Wear")
FREE = replace(SURE, sort="free")
SOUND = Doubt(0.95, (), ())
LACKING: Any = {"name": "e", "title": "An effect", "module": "A", "place": "Q_gap"}
NO_SENSOR = Missing(**LACKING, quantity="temperature", sensor="thermometer")
STRAINED = Strain("V.Kv", 6.8, 33.0, 6.0, "m3/h/bar**0.5")


def fit_of(repaired: float = 0.4, noise: float = 0.1, signal: str = "A.Q", **more: Any) -> Fit:
    """A reading that the repaired model meets to so much; recalibrated it is off by 1."""
    errors = Errors(shipped=2.0, recalibrated=1.0, repaired=repaired, noise=noise, points=10)
    fixed: dict[str, Any] = {"estimation": errors, "gain_interval": (0.0, 0.0), "closed": 1.0}
    return Fit(signal=signal, unit="l/min", heldout=errors, **{**fixed, **more})


@pytest.mark.parametrize(
    ("findings", "left", "verdict", "headline"),
    [
        ((), False, "none", "The model is complete: recalibrated, it agrees"),
        ((), True, "unnamed", "Something is missing at the plant that no known effect"),
        ((SURE,), True, "named", "The model lacks gap flow that follows the temperature in A"),
        ((AGEING,), False, "named", "The model lacks wear in A."),
        ((UNSURE,), False, "ambiguous", "Not decided: gap flow"),
        ((FAULT, SENSOR), False, "fault", "The model is right; the plant has a fault: flow lost"),
        ((SENSOR, FAULT), False, "sensor", "The model is right; a sensor is not: reading shifted"),
        ((FAULT, SURE), False, "named", "The model lacks gap flow"),
        ((replace(FAULT, probability=0.5), SURE), False, "named", "The model lacks"),
        ((FREE,), False, "unnamed", "Something is missing at the plant"),
        ((FREE, SENSOR), False, "sensor", "The model is right; a sensor is not: reading shifted"),
    ],
)
def test_verdict_and_headline(
    findings: Sequence[Finding], left: bool, verdict: str, headline: str
) -> None:
    """Physics decides before faults and sensors; a free form is no name."""
    assert verdict == verdict_of(findings, left, SOUND)
    text = headline_of(verdict, findings, (), SOUND)
    assert text.startswith(headline)
    assert "lacks flow lost" not in text


def test_what_has_no_name_is_told_at_its_own_place() -> None:
    at: Any = {"module": UNSURE.module, "place": UNSURE.place, "title": ""}
    large = Location(**at, share=0.8, region=(), periods=())
    small = replace(large, module="B", place="Q_imp", share=0.2)
    for where, expected in (((large, small), "B.Q_imp"), ((large,), f"A.{UNSURE.place}")):
        assert f"missing at {expected} that no" in headline_of("unnamed", (UNSURE,), where, SOUND)


def rivalled(own: float, *others: tuple[str, float]) -> Finding:
    """A finding of some probability, with titles and probabilities of others."""
    found = tuple(Alternative(title, "x", title, p) for title, p in others)
    return replace(WARM, title="Gap flow", probability=own, alternatives=found)


LAWS = rivalled(0.25, ("Law 0", 0.25), ("Law 1", 0.25), ("Law 2", 0.25))
TWINS = rivalled(0.5, ("A.dp reads high", 0.25), ("A.dp reads high", 0.25))
NEARLY = (SENSOR, replace(SURE, probability=0.7))


@pytest.mark.parametrize(
    ("verdict", "findings", "noise", "expected", "never"),
    [
        # Else the law's form may be wrong, or the name is not all.
        ("none", (), 0.3, "it agrees with the recording", "off by"),
        ("none", (), 0.1, "A.Q is off by 4 times its noise", "it agrees with the recording"),
        ("named", (SURE, replace(FAULT, probability=0.4)), 1, "; not sure: flow lost in A.", "has"),
        ("ambiguous", NEARLY, 1, "Not sure enough to be named: gap flow", "law"),
        ("ambiguous", NEARLY, 1, " Certain: reading shifted in A.", "law"),
        ("named", (rivalled(0.75, ("Another one", 0.25)),), 1, "another one", "decided"),
        ("named", (rivalled(0.95, ("Another one", 0.05)),), 1, "gap flow", "another one"),
        # Four laws that say the same share the odds, and are one joint finding.
        ("ambiguous", (LAWS,), 1, "law 0", "law 3"),
        ("ambiguous", (LAWS,), 1, "law 2", "law 3"),
        # Alternatives of one title are one.
        ("ambiguous", (TWINS,), 1, "flow in A (50\u00a0%) or A.dp reads high (50\u00a0%).", ","),
    ],
)
def test_what_the_headline_tells(
    verdict: str, findings: Sequence[Finding], noise: float, expected: str, never: str
) -> None:
    headline = headline_of(verdict, findings, (), SOUND, [fit_of(noise=noise)])
    assert expected in headline
    assert never not in headline
    assert verdict != "ambiguous" or verdict_of(findings, False, SOUND) == "ambiguous"


def test_what_is_left_is_told_of_what_has_a_name() -> None:
    off = " However, A.Q is still off by 4 times its noise."
    reports = (("named", 0.1), ("named", 0.2), ("named", 0.0), ("unnamed", 0.1))
    assert [off, "", "", ""] == [remainder_of(v, [fit_of(noise=noise)]) for v, noise in reports]


def test_an_explanation_that_no_plant_can_hold_is_judged_by_itself() -> None:
    """Ageing, or a law whose driver belongs to another module: adopt writes nothing of it."""
    fit = fit_of(noise=0.1)
    held = replace(fit.heldout, explained=fit.heldout.noise)
    whole = replace(fit, heldout=held)
    assert remainder_of("named", [fit_of(noise=0.1), whole])
    assert "" == remainder_of("named", [fit_of(noise=0.1), whole], written=False)
    step = next_step("named", (SURE,), None, (), unwritable="a module type knows no time")
    assert step.startswith(SURE.action[0].upper() + SURE.action[1:])
    assert "Write the repaired" not in step
    assert "cannot write it: a module type knows no time" in step


def test_a_value_that_nobody_believes_is_told_with_what_has_a_name() -> None:
    """A tank without a cross-section fits swapped columns."""
    said = "far from the sheet: V.Kv 6.8 m3/h/bar**0.5, sheet 33 ± 6: 4.4 u."
    off = " However, A.Q is still off by 4 times its noise; "
    told = [remainder_of("named", [fit_of(noise=noise)], [STRAINED]) for noise in (0.1, 0.2)]
    assert [off + said, f" However, {said}"] == told
    assert f" However, {said}" == remainder_of("unnamed", [fit_of(noise=0.1)], [STRAINED])


def test_what_may_as_well_not_be_missing_is_no_claim() -> None:
    """It is mentioned with its probability, an experiment would tell, and there is no tick."""
    named = ((0.6, ("Relief valve in A",)), (0.3, ()), (0.05, ("Wear in A",)))
    rest: Any = {"joined": (), "values": {}, "fixed": {}, "periods": (), "terms": ()}
    sets = tuple(CandidateSet(names=t, titles=t, probability=p, **rest) for p, t in named)
    doubt = Doubt(0.3, (), ())
    assert "unsure" == verdict_of((), False, doubt)
    assert headline_of("unsure", (), (), doubt, [fit_of(noise=0.3)], sets) == (
        "Perhaps nothing is missing (30\u00a0%). "
        "Possible explanations: relief valve in A (60\u00a0%)."
    )
    for verdict, findings in (("unsure", ()), ("ambiguous", (UNSURE,))):
        step = next_step(verdict, findings, None, (), standing=sets)
        assert "`rulec experiment`" in step
    unlikely = tuple(
        replace(s, probability=p) for s, p in zip(sets, (0.05, 0.93, 0.02), strict=True)
    )
    step = next_step("unsure", (), None, (), standing=unlikely)
    assert step.startswith("Check the data sheets")  # no experiment separates what nobody names


@pytest.mark.parametrize(
    ("doubt", "said"),
    [
        (Doubt(1.0, (), (STRAINED,)), "V.Kv 6.8 m3/h/bar**0.5, sheet 33 ± 6: 4.4 u"),
        (Doubt(1.0, ((fit_of(), 0.36),), ()), "A.Q is off by 36\u00a0%"),
        (Doubt(0.01, (), ()), "only 1\u00a0% that nothing is missing"),
    ],
)
def test_no_tick_where_something_speaks_against_it(doubt: Doubt, said: str) -> None:
    assert "unsure" == verdict_of((), False, doubt)
    headline = headline_of("unsure", (), (), doubt)
    assert headline == f"Something is missing, but this recording does not say what: {said}."
    assert "Do not adopt" in next_step("unsure", (), None, ())
    # The most likely ones that would spare the sheet, however unlikely beside a wrong sheet.
    rest: Any = {"joined": (), "values": {}, "fixed": {}, "periods": (), "terms": ()}
    named = ((0.9, ()), (0.06, ("Missing head in A",)), (0.001, ("Wear in A",)))
    sets = [CandidateSet(names=t, titles=t, probability=p, **rest) for p, t in named]
    sheet = " If the sheet is right: perhaps missing head in A." if doubt.strain else ""
    assert headline_of("unsure", (), (), doubt, standing=sets) == headline + sheet
    near = replace(STRAINED, value=18.0)
    assert "none" == verdict_of((), False, Doubt(0.95, (), (near,)))


@pytest.mark.parametrize(
    ("verdict", "findings", "expected"),
    [
        ("none", (), "Nothing to do."),
        ("cannot judge", (), "Record settled operation"),
        ("named", (SURE,), "Write the repaired module types with `rulec adopt`"),
        ("ambiguous", (UNSURE,), "Record a part in which the drivers"),
        ("fault", (FAULT,), FAULT.action),
        ("sensor", (SENSOR,), SENSOR.action),
        ("unnamed", (), "Record thermometer: An effect would then be judged."),
    ],
)
def test_next_step(verdict: str, findings: Sequence[Finding], expected: str) -> None:
    assert next_step(verdict, findings, None, (NO_SENSOR,)).startswith(expected)
    step = next_step("named", (SURE,), UNNAMED.latent_input, ())
    assert f"Record {UNNAMED.latent_input.sensor} together with the rest, and run again." == step


@pytest.mark.parametrize(
    ("repaired", "interval", "noise", "spoiled"),
    [
        (1.2, (-0.4, -0.02), 0.1, True),
        (1.2, (-0.4, 0.1), 0.1, False),  # by chance
        (1.04, (-0.06, -0.02), 0.1, False),  # hardly
        (1.2, (-0.4, -0.02), 1.5, False),  # noise
        (0.4, (0.5, 0.7), 0.1, False),
    ],
)
def test_a_repair_that_does_harm_is_not_to_be_adopted(
    repaired: float, interval: tuple[float, float], noise: float, spoiled: bool
) -> None:
    """On a real station two of eight pumps were predicted worse, and the rest better."""
    well = fit_of(0.5, noise, "A.dp", gain_interval=(0.4, 0.6))
    fits = [well, fit_of(repaired, noise, gain_interval=interval)]
    refused = refusal("named", fits, ["A.x@Q"], "")
    assert spoiled == refused.startswith("simulated with it, A.Q is off by 1.2 l/min")
    step = next_step("named", (SURE,), None, (), refused)
    assert spoiled == step.startswith("Do not adopt this as it is: simulated with it")


def test_what_is_worse_than_recalibration_is_not_written() -> None:
    """However little, where it is the reading that the proof is about; fitted data do not count."""
    effect = ["A.x@Q"]
    worse = fit_of(1.001, estimation=fit_of(0.1).heldout, gain_interval=(-0.1, 0.1))
    assert "off by 1 l/min on held-out samples" in refusal("named", [worse], effect, "")
    assert "" == refusal("named", [worse], [], "")
    perhaps = fit_of(0.9, gain_interval=(-0.004, 0.2))
    chance = refusal("named", [perhaps], effect, "")
    assert "0.4 to 20 % (95 %) compared with recalibrated values only" in chance
    better = [fit_of(0.9, gain_interval=(0.02, 0.2))]
    whole = Check(signal="A.Q", rows=100, error=1.4, plain=1.3)
    assert "" == refusal("named", better, effect, "", [replace(whole, error=1.2)])
    said = refusal("named", better, effect, "", [whole])
    assert "off by 1.4 l/min over all held-out rows" in said
    assert "cannot decide between" in refusal("ambiguous", better, effect, "")
    curve = CurveTerm("definition:A.x", "A.n", ((0.0, 0.0), (1.0, 1.0)))
    assert "" == refusal("ambiguous", better, [curve.id], "", curves=[curve])
    assert "it cannot be written: why" == refusal("named", [], effect, "why")


def test_a_sentence_states_shares_in_per_cent() -> None:
    """A fixed number has its title."""
    unknowns = [SimpleNamespace(name=n, title="median", fixed=n == "T0") for n in ("b", "T0")]
    text = "the slip changes by {b:%} ({b}) with A.T from its {T0}"
    candidate: Any = SimpleNamespace(unknowns=unknowns, place="Q_gap", text=text)
    words = sentence(candidate, {"b": Estimate("rise", 0.0304, 0.0009, 0.029, 0.032, "1/K")}, ())
    rise = "3.040 ± 0.090 %/K (0.03040 ± 0.00090 1/K)"
    assert words == f"the slip changes by {rise} with A.T from its median"
