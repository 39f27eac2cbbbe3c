"""A comparison on the terminal, as JSON and as a page: content, order, texts, absent numbers."""

import dataclasses
import io
import json
from typing import Any

import numpy as np
import pytest
from rulec_runtime.output.terminal import Terminal
from rulec_runtime.report.text import number

from rulec.knowledge.parameter_belief import Strain
from rulec.mismatch.answer.findings import update_sentence as updated
from rulec.mismatch.answer.json_form import hidden_csv, mismatch_form
from rulec.mismatch.answer.story import explained_words
from rulec.mismatch.answer.terminal_and_page import ReadingCourses, curves_of, rms, tell
from rulec.mismatch.result import (
    Errors,
    Evidence,
    Likely,
    Mismatch,
    Moved,
    OfRecording,
    Period,
    Region,
    Update,
)
from tests.runtime.mismatches import ALL, FAULT, NAMED, NAN, UNNAMED, broken, curves, spoken
from tests.runtime.pages import mismatch_page as report
from tests.runtime.reports import NEEDS_MORE, NO_NUMBER, caption, figures, tree


def story(mismatch: Mismatch, width: int = 80) -> str:
    """What a terminal of some width shows."""
    out = io.StringIO()
    tell(Terminal(file=out, width=width, color_system=None), mismatch)
    return out.getvalue().replace("\xa0", " ")


def words(mismatch: Mismatch, **changed: Any) -> str:
    """The story as one row of words, of a mismatch with something changed."""
    return " ".join(story(dataclasses.replace(mismatch, **changed), 400).split())


def page(mismatch: Mismatch) -> str:
    return report(mismatch).replace("\xa0", " ").replace("&gt;", ">")


def in_order(text: str, *parts: str) -> bool:
    places = [text.index(part) for part in parts]
    return sorted(places) == places


USUAL = ("time", "driver0", "driver1")
DRIVER_FIRST = ("driver0", "time", "driver1")
VERDICTS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "named": ("Physics left out of the model", "◆ M", DRIVER_FIRST),
    "ambiguous": ("A mismatch with several possible explanations", "▲ S", DRIVER_FIRST),
    "fault": ("A fault of the plant, not of the model", "✖ F", USUAL),
    "sensor": ("An error of a sensor, not of the model", "✖ F", USUAL),
    "unnamed": ("A mismatch that nothing known explains", "▲ S", (*DRIVER_FIRST, "hidden")),
    "none": ("No mismatch", "✓ ok", USUAL),
    "cannot judge": ("Cannot judge", "▼ C", ()),
}
"""Words; symbol and letter, which say it without colour; figures, what it depends on first."""

KEYS = {"plant", "recording", "verdict", "locations", "effects", "fit", "confounded"}
KEYS |= {"hidden_driver", "next", "seconds"}


@pytest.mark.parametrize("case", ALL)
def test_every_verdict_is_told(case: str) -> None:
    """On one screen, a page that asks for nothing else, and a form with all keys; nowhere a number
    that is not known."""
    rows = story(ALL[case]).splitlines()
    assert [] == [row for row in rows if len(row) > 80]
    assert 45 >= len(rows)
    rows = [row for row in story(ALL[case], 200).splitlines() if row]
    words, badge, pictures = VERDICTS[case]
    assert (f"{badge[0]} {words}", ALL[case].headline) == (rows[0], rows[2])
    text = story(broken(ALL[case])).replace("(", " ").lower()
    assert set(text.split()).isdisjoint(("nan", "inf", "-inf"))
    for mismatch in (ALL[case], broken(ALL[case])):
        form = mismatch_form(mismatch, "plants/abc")
        assert KEYS - set(form) == set()
        json.dumps(form, allow_nan=False)
        page = report(mismatch)
        assert badge == tree(page).findtext(".//header//span")
        assert [] == NO_NUMBER.findall(page) + NEEDS_MORE.findall(page)
    assert list(pictures) == figures(report(ALL[case]))


def test_rows_are_counted() -> None:
    told = words(NAMED)
    assert "400 of 427 rows used: 300 for search and fit; 100 held out" in told
    assert "not used 19: A.n is below 60 rpm" in told
    form = mismatch_form(NAMED, "plant.yaml")
    assert {"rows": 8, "used": False, "because": "not settled"} in form["evidence"]
    assert "A.n is below 60 rpm" in page(NAMED)
    many = tuple(Evidence(20 - i, False, f"reason {i}") for i in range(10))
    told = words(NAMED, evidence=many)
    assert "20: reason 0 19: reason 1 18: reason 2 98: others" in told


def test_what_speaks_against_a_repair_is_told() -> None:
    strain = (Strain("V.Kv", 6.8, 33.0, 6.0, "m3/h"),)
    doubted = dataclasses.replace(NAMED, refused="it may be chance", strain=strain)
    for text in (words(doubted), page(doubted)):
        assert "Not proven: it may be chance, so rulec adopt will refuse. On 100 held-out" in text
        assert "Proof" not in text
        assert "V.Kv 6.8 m3/h, sheet 33 ± 6: 4.4 u" in text
    (form,) = mismatch_form(doubted, "plant.yaml")["strain"]
    assert ("V.Kv", 33.0) == (form["parameter"], form["stated"])


def test_named_effect_is_told_in_words_and_numbers() -> None:
    """1 - 0.93/4.4 is 79 %; each part stands below the one that it rests on."""
    text = words(NAMED)
    for expected in (
        "the gap flow grows by 0.0231 1/K with A.T",
        "probability 93 %, physics missing from the model",
        "could also be Gap flow that grows with time (5 %)",
        "gap flow of the dosing pump (A.Q_gap): 83 % of the mismatch",
        "A.T above 45 degC (97 % of it)",
        "A: b, rise of the gap flow per kelvin 0.0231 0.0011 0.0209 to 0.0253 1/K",
        "A: T0, temperature of the plain law 45.2 – fixed degC",
        "confounded A.b and A.C2 (correlation −0.93)",
        "untested A.T above 55 degC",
        "On 100 held-out points the error falls by 79 % against recalibration "
        "(95 %: 71 % to 85 %); 97 % of the explainable mismatch is closed.",
        "also A.dp 0.08 as shipped, 0.06 recalibrated, 0.022 repaired, 0.02 estimated noise bar",
    ):
        assert expected in text
    assert "Nothing of importance" not in text
    order = ("Module A: the gap", "where gap", "Proof:", "Numbers", "blocks of 40 s", "Next")
    assert in_order(text, *order)


def test_a_repair_that_makes_worse_is_said_to() -> None:
    errors = Errors(shipped=8.0, recalibrated=4.0, repaired=5.0, noise=1.0, points=1)
    fit = dataclasses.replace(NAMED.fit, heldout=errors, gain_interval=(-0.5, -0.1), closed=-0.6)
    expected = (
        "On 1 held-out point the error rises by 25 % against recalibration (95 %: −50 % to −10 %); "
        "−60 % of the explainable mismatch is closed."
    )
    assert expected in words(NAMED, fit=fit)


def test_periods_of_a_fault() -> None:
    """The four largest of six in order of time; the machine form has all."""
    text = words(FAULT)
    assert "when 80 to 105 s: degree 0.150 ± 0.004" in text
    assert "200 to 225 s: degree 0.300 ± 0.004" in text
    assert "and 2 other periods, none larger" in text
    assert "degree 0.100" not in text
    [effect] = mismatch_form(FAULT, "x")["effects"]
    assert 6 == len(effect["periods"])
    assert {"since": 0.0, "until": 25.0, "degree": 0.05, "u": 0.004} == effect["periods"][0]
    finding = dataclasses.replace(FAULT.findings[0], periods=(Period(5.0, NAN, 0.1, NAN),))
    assert "5 to – s: degree 0.100 ± –" in words(FAULT, findings=(finding,))


def test_hidden_driver_shows_course_and_sensor() -> None:
    text = words(UNNAMED)
    assert "could be the liquid's temperature and the level of the tank" in text
    assert "sensor a thermometer at the inlet of A" in text
    assert "7.99 l/h ┤" in text
    rows = hidden_csv(UNNAMED.hidden).splitlines()
    assert ("35,", 81) == (rows[8], len(rows))


def test_hostile_texts_stay_text() -> None:
    hostile = "[bold]x[/bold] [/] [red] \\"
    assert 15 <= story(spoken(hostile), 400).count(hostile)
    page = tree(report(spoken("<script src='//x'>\"&\u202e\x07</script>")))
    assert [] == [*page.iter("script"), *page.iter("img")]
    assert "<script src='//x'>\"&\ufffd\ufffd</script>" == page.findtext(".//h1")


def test_machine_form_of_a_named_effect() -> None:
    form: dict[str, Any] = mismatch_form(NAMED, "plants/abc")
    [location], [effect] = form["locations"], form["effects"]
    assert ("A", "Q_gap", 0.83) == tuple(location[k] for k in ("module", "place", "share"))
    region = {"variable": "A.T", "from": 45.0, "to": None, "unit": "degC", "share": 0.97}
    assert [region] == location["region"]
    assert "warm-gap" == effect["effect"]
    b = effect["parameters"]["b"]
    assert (0.0231, 0.0011, "1/K") == (b["value"], b["u"], b["unit"])
    assert [("age", 0.05), ("odd", 0.002)] == [
        (a["effect"], a["probability"]) for a in effect["alternatives"]
    ]
    assert {"shipped", "recalibrated", "repaired"} <= set(form["fit"]["estimation"])
    assert ["A.Q", "A.dp"] == [f["signal"] for f in form["fits"]]
    heldout = form["fit"]["heldout"]
    assert (0.93, 0.9, [0.71, 0.85]) == tuple(
        heldout[k] for k in ("repaired", "noise", "gain_interval")
    )
    assert 0.97 == form["fit"]["closed"]


def test_machine_form_carries_the_repair() -> None:
    """What adopt needs: the candidate with its unknowns and fixed values, all parameters in SI."""
    repair = mismatch_form(NAMED, "plants/abc/plant.yaml")["repair"]
    assert {
        "plant": "plants/abc/plant.yaml",
        "joined": [
            {
                "id": "A.warm-gap@Q_gap",
                "effect": "warm-gap",
                "module": "A",
                "place": "Q_gap",
                "unknowns": {"A.warm-gap@Q_gap.b": 0.0231},
                "fixed": {"A.warm-gap@Q_gap.T0": 318.35},
            }
        ],
        "curves": [],
        "parameters": ["A.C2", "A.warm-gap@Q_gap.b"],
        "values": [5.6e-17, 0.0231],
        "covariance": [[1e-36, -9e-22], [-9e-22, 1.2e-6]],
        "misfit": {"A.pump": 2.5e-7},
        "range": {},
        "left_out": [],
        "refused": None,
        "checks": [],
        "recalibrated": None,
        "misread": [],
        "rewired": [],
    } == repair


def test_what_no_model_may_hold_is_told_apart() -> None:
    """The errors are those of plants that can be written; the whole explanation stands beside."""
    assert "" == explained_words(NAMED)
    held = dataclasses.replace(NAMED.fit.heldout, explained=0.25)
    found = NAMED.findings[0]
    told = dataclasses.replace(
        NAMED, fit=dataclasses.replace(NAMED.fit, heldout=held), left_out=((found.id, "why"),)
    )
    expected = f"With what a plant model cannot hold ({found.title} in A), the error falls to 0.25"
    assert expected in explained_words(told)


def test_several_recordings_are_told_with_what_each_changed() -> None:
    slip, speed = "slip by temperature", "slip by speed"
    alone = (Likely("a", slip, 0.68), Likely("b", speed, 0.29))
    moved = (Moved("a", slip, 0.68, 0.97), Moved("b", speed, None, 0.02))
    several = dataclasses.replace(
        NAMED,
        recordings=(
            OfRecording("one.csv", 144, 133, "ambiguous", alone),
            OfRecording("two.csv", 144, 131, "none", ()),
        ),
        changed=(Update("two.csv", updated("two.csv", moved), moved),),
    )
    told = words(several)
    assert (
        "one.csv 133 of 144 rows used; alone: a mismatch with several possible explanations "
        "(slip by temperature 68 %; slip by speed 29 %)"
    ) in told
    assert "two.csv 131 of 144 rows used; alone: no mismatch" in told
    sentence = "With two.csv: slip by temperature 68 % -> 97 %; slip by speed 2 %"
    assert f"changed {sentence}" in told
    assert sentence in page(several)
    assert "133 of 144 rows used" in page(several)
    form = json.loads(json.dumps(mismatch_form(several, "plant.yaml")))
    assert ["one.csv", "two.csv"] == [part["name"] for part in form["recordings"]]
    assert {"id": "a", "title": slip, "probability": 0.68} == form["recordings"][0]["alone"][0]
    after = {"id": "b", "title": speed, "before": None, "after": 0.02}
    assert after == form["changed"][0]["moved"][1]


def drawn(mismatch: Mismatch) -> ReadingCourses:
    return curves_of(mismatch)


def test_captions_are_computed() -> None:
    """From the curves alone."""
    c, page = curves(), report(NAMED)
    before, after = c.measured - c.recalibrated, c.measured - c.repaired
    title, readings = next(iter(c.drivers.items()))
    edges = np.linspace(readings.min(), readings.max(), 25)
    place = np.minimum(np.digitize(readings, edges) - 1, 23)
    spans = []
    for error in (before, after):
        medians = [np.median(error[place == i]) for i in range(24) if (place == i).sum() >= 3]
        spans.append(number(float(max(medians) - min(medians)), 2))
    expected = (
        f"Figure 1. Over {title} the median error spans {spans[0]} l/h before the repair and "
        f"{spans[1]} l/h after it."
    )
    assert expected == caption(page, "driver0")

    def off(flags: np.ndarray) -> str:
        sizes = [number(float(np.sqrt(np.mean(e[flags] ** 2))), 2) for e in (before, after)]
        return (
            f"the recalibrated model is off by {sizes[0]} l/h rms, the repaired one by "
            f"{sizes[1]} l/h"
        )

    warm = readings >= 45.0
    expected = f"Figure 2. In the shaded {round(100 * warm.mean())} % {off(warm)}; outside it "
    assert f"{expected}{off(~warm)}." == caption(page, "time")
    styles = [p.get("class") for p in tree(page).findall(".//figure[@id='time']//path")]
    assert (2, 2) == (styles.count("band located"), styles.count("band heldout"))


def test_a_mismatch_is_located_by_readings_or_else_in_time() -> None:
    time, warm = curves().time, curves().drivers["A.T [degC]"]
    np.testing.assert_array_equal(warm >= 45.0, drawn(NAMED).located)
    periods = (time <= 25.0) | ((time >= 200.0) & (time <= 225.0))
    strange = Region("B.T", 45.0, None, "degC", 1.0)
    elsewhere = dataclasses.replace(FAULT.locations[0], region=(strange,))
    for mismatch in (FAULT, dataclasses.replace(FAULT, locations=(elsewhere,))):
        np.testing.assert_array_equal(periods, drawn(mismatch).located)


def test_points_in_faults_do_not_count() -> None:
    c = curves()
    measured = np.where(c.time < 100, 0.0, c.measured)
    faulty = dataclasses.replace(c, measured=measured, inside=c.time >= 100)
    found = drawn(dataclasses.replace(NAMED, curves=faulty))
    error = found.error("repaired")
    assert rms((c.measured - c.repaired)[100:]) == rms(error[np.isfinite(error)])
    assert 0.0 == found.curves.measured[0]


@pytest.mark.parametrize("samples", [1, 2, 3, 100_000])
def test_any_number_of_samples_makes_a_page(samples: int) -> None:
    page = report(dataclasses.replace(NAMED, curves=curves(samples)))
    assert list(DRIVER_FIRST) == figures(page)
    assert [] == NO_NUMBER.findall(page)
    assert 600_000 > len(page)


def test_samples_out_of_order_or_without_time_are_sorted_out() -> None:
    """A chart needs an increasing time; of no sample, or none that was measured, there is none."""
    c = curves()
    time = c.time[::-1].copy()
    time[3] = NAN
    found = drawn(dataclasses.replace(NAMED, curves=dataclasses.replace(c, time=time)))
    ordered = found.curves.time
    assert (len(time) - 1, True) == (len(ordered), bool((np.diff(ordered) > 0).all()))
    unmeasured = dataclasses.replace(c, measured=np.full(len(c.time), NAN))
    names = [f.name for f in dataclasses.fields(c) if f.name != "drivers"]
    none = dataclasses.replace(c, **dict.fromkeys(names, c.time[:0]), drivers={"x": c.time[:0]})
    for empty in (none, unmeasured):
        assert curves_of(dataclasses.replace(NAMED, curves=empty)) is None
