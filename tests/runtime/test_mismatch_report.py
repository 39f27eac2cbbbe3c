"""The report of a comparison: sound, self-contained, computed from what it shows."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from rulec_runtime.report.text import number

from rulec.mismatch.answer.pictures import ReadingCourses, curves_of, middle_by, rms
from rulec.mismatch.result import Curves, Mismatch, Region
from tests.runtime.mismatches import (
    ALL,
    CANNOT_JUDGE,
    FAULT,
    NAMED,
    NAN,
    NONE,
    UNNAMED,
    WARM,
    broken,
    curves,
)
from tests.runtime.pages import mismatch_page as report
from tests.runtime.reports import caption, figures, tree

UNKNOWN = re.compile(r"[ \"(]-?(?:nan|inf)\b")
"""Numbers that no page may show."""

HOSTILE = "<script src='//x'>\"&\u202e\x07</script>"


def drawn(mismatch: Mismatch) -> ReadingCourses:
    found = curves_of(mismatch)
    assert found is not None
    return found


def plain(page: str) -> str:
    """All words of the body, in order."""
    body = tree(page).find("body")
    assert body is not None
    return " ".join(" ".join(body.itertext()).replace("\xa0", " ").split())


@pytest.mark.parametrize("case", ALL)
def test_every_verdict_gives_a_sound_page(case: str) -> None:
    """Well-formed, without NaN, also where no number is known."""
    for mismatch in (ALL[case], broken(ALL[case])):
        page = report(mismatch)
        tree(page)
        assert [] == UNKNOWN.findall(page)


@pytest.mark.parametrize(
    ("mismatch", "expected"),
    [
        (NAMED, ["driver0", "time", "driver1"]),
        (FAULT, ["time", "driver0", "driver1"]),
        (UNNAMED, ["driver0", "time", "driver1", "hidden"]),
        (NONE, ["time", "driver0", "driver1"]),
        (CANNOT_JUDGE, []),
    ],
    ids=["named", "fault", "unnamed", "none", "cannot judge"],
)
def test_pictures_are_those_the_comparison_allows(mismatch: Mismatch, expected: list[str]) -> None:
    """What it depends on is first; what is not recorded has its course."""
    assert expected == figures(report(mismatch))


def test_page_needs_nothing_else() -> None:
    """No address, no script, no import."""
    page = report(NAMED)
    assert [] == re.findall(r"https?:|//\w|<script|<img|<link|@import|url\(|\ssrc=|\son\w+=", page)


def test_same_comparison_same_bytes() -> None:
    """No date, no order by chance."""
    assert report(NAMED) == report(dataclasses.replace(NAMED))


def test_hostile_texts_stay_text() -> None:
    """Titles, places, units, drivers and notes come out as written, never as markup."""
    finding = dataclasses.replace(
        WARM,
        **dict.fromkeys(("name", "title", "module", "place", "text", "action", "source"), HOSTILE),
        equation=HOSTILE,
        parameters={HOSTILE: dataclasses.replace(WARM.parameters["b"], title=HOSTILE, unit="<i>")},
        alternatives=tuple(dataclasses.replace(a, title=HOSTILE) for a in WARM.alternatives),
        rivals=tuple(dataclasses.replace(r, title=HOSTILE) for r in WARM.rivals),
        periods=FAULT.findings[0].periods,
    )
    assert NAMED.fit is not None
    assert UNNAMED.hidden is not None
    mismatch = dataclasses.replace(
        NAMED,
        **dict.fromkeys(("plant", "title", "recording", "headline", "next", "noise"), HOSTILE),
        split=HOSTILE,
        digest=HOSTILE,
        notes=(HOSTILE,),
        untested=(HOSTILE,),
        findings=(finding,),
        fit=dataclasses.replace(NAMED.fit, signal=HOSTILE, unit=HOSTILE),
        locations=(dataclasses.replace(NAMED.locations[0], title=HOSTILE, also=(HOSTILE,)),),
        hidden=dataclasses.replace(
            UNNAMED.hidden, module=HOSTILE, text=HOSTILE, unit=HOSTILE, sensor=HOSTILE
        ),
        curves=dataclasses.replace(curves(), drivers={HOSTILE: curves().time}),
    )
    page = tree(report(mismatch))
    assert [] == [*page.iter("script"), *page.iter("img")]
    heading = page.find(".//h1")
    assert heading is not None
    assert "<script src='//x'>\"&��</script>" == heading.text


def test_finding_comes_first() -> None:
    """Order: what is missing, next, what it depends on, pictures, proof, numbers."""
    page = report(NAMED)
    places = [
        page.index(part)
        for part in (
            NAMED.headline.removesuffix("."),
            "Module A: the gap",
            NAMED.next,
            '<figure id="driver0"',
            '<figure id="time"',
            "Proof: ",
            "Numbers</h2>",
        )
    ]
    assert sorted(places) == places


def test_badge_has_symbol_and_letter() -> None:
    """The verdict is read by shape and letter, not by colour."""
    badges = {m.verdict: tree(report(m)).find(".//header//span") for m in ALL.values()}
    expected = {
        "named": "◆ M",
        "ambiguous": "▲ S",
        "fault": "✖ F",
        "sensor": "✖ F",
        "unnamed": "▲ S",
        "none": "✓ ok",
        "cannot judge": "▼ C",
    }
    assert expected == {k: badge.text for k, badge in badges.items() if badge is not None}


def test_caption_over_time_is_computed() -> None:
    """Errors inside the located region and outside it, from the curves alone."""
    c = curves()
    before, after = c.measured - c.recalibrated, c.measured - c.repaired

    def off(flags: np.ndarray) -> str:
        sizes = [number(float(np.sqrt(np.mean(e[flags] ** 2))), 2) for e in (before, after)]
        return (
            f"the recalibrated model is off by {sizes[0]} l/h rms, the repaired one by "
            f"{sizes[1]} l/h"
        )

    warm = c.drivers["A.T [degC]"] >= 45.0
    share = f"{round(100 * warm.mean())} %"
    expected = f"Figure 2. In the shaded {share} {off(warm)}; outside it {off(~warm)}."
    assert expected == caption(report(NAMED), "time")


def test_caption_over_a_driver_is_computed() -> None:
    """Over the temperature the median error spans much before the repair and little after it."""
    c = curves()
    title, readings = next(iter(c.drivers.items()))
    spans = []
    for error in (c.measured - c.recalibrated, c.measured - c.repaired):
        edges = np.linspace(readings.min(), readings.max(), 25)
        place = np.minimum(np.digitize(readings, edges) - 1, 23)
        medians = [np.median(error[place == i]) for i in range(24) if (place == i).sum() >= 3]
        spans.append(number(float(max(medians) - min(medians)), 2))
    expected = (
        f"Figure 1. Over {title} the median error spans {spans[0]} l/h before the repair and "
        f"{spans[1]} l/h after it."
    )
    assert expected == caption(report(NAMED), "driver0")


def test_the_most_telling_driver_is_drawn_first() -> None:
    """That over which the error moves most, whatever the order of the readings; four at most."""
    c = curves()
    more = {f"B.x{i} [1]": np.sin(i + c.time) for i in range(5)}
    page = report(
        dataclasses.replace(NAMED, curves=dataclasses.replace(c, drivers={**more, **c.drivers}))
    )
    titles = [h.text for h in tree(page).findall(".//figure/h3")]
    assert "Error over A.T [degC]" == titles[0]
    assert 4 == sum((title or "").startswith("Error over") for title in titles)


def test_before_and_after_stand_in_two_panels() -> None:
    """Without a repair there is one."""
    for mismatch, panels in ((NAMED, 2), (NONE, 1)):
        found = tree(report(mismatch)).findall(".//figure[@id='driver0']//svg[@role='img']")
        assert panels == len(found)
        assert 1 == len(
            tree(report(mismatch)).findall(".//figure[@id='driver0']//div[@class='below']")
        )


def test_held_out_and_located_parts_are_shaded() -> None:
    """Each in a band of its own, and the key says which is which."""
    page = tree(report(NAMED))
    styles = [p.get("class") for p in page.findall(".//figure[@id='time']//path")]
    assert (2, 2) == (styles.count("band located"), styles.count("band heldout"))
    key = page.find(".//figure[@id='time']/p")
    assert key is not None
    assert (
        "thin: measured; shaded: where the mismatch was located; grey at the foot: held out"
        == key.text
    )


def test_a_mismatch_is_located_by_readings_or_else_in_time() -> None:
    """Inside all regions of a location; by its periods where no region can be drawn."""
    time, warm = curves().time, curves().drivers["A.T [degC]"]
    np.testing.assert_array_equal(warm >= 45.0, drawn(NAMED).located)
    periods = (time <= 25.0) | ((time >= 200.0) & (time <= 225.0))
    np.testing.assert_array_equal(periods, drawn(FAULT).located)
    strange = Region("B.T", 45.0, None, "degC", 1.0)
    elsewhere = dataclasses.replace(FAULT.locations[0], region=(strange,))
    found = drawn(dataclasses.replace(FAULT, locations=(elsewhere,)))
    np.testing.assert_array_equal(periods, found.located)


def test_points_in_faults_do_not_count() -> None:
    """They are drawn, but neither captions nor clouds know them."""
    c = curves()
    measured = np.where(c.time < 100, 0.0, c.measured)
    faulty = dataclasses.replace(c, measured=measured, inside=c.time >= 100)
    found = drawn(dataclasses.replace(NAMED, curves=faulty))
    error = found.error("repaired")
    assert rms((c.measured - c.repaired)[100:]) == rms(error[np.isfinite(error)])
    assert 0.0 == found.curves.measured[0]


def test_long_recordings_are_thinned() -> None:
    """A hundred thousand samples make a page of half a megabyte."""
    page = report(dataclasses.replace(NAMED, curves=curves(100_000)))
    assert ["driver0", "time", "driver1"] == figures(page)
    assert 600_000 > len(page)


def test_samples_out_of_order_or_without_time_are_sorted_out() -> None:
    """A chart needs an increasing time."""
    c = curves()
    time = c.time[::-1].copy()
    time[3] = NAN
    found = drawn(dataclasses.replace(NAMED, curves=dataclasses.replace(c, time=time)))
    ordered = found.curves.time
    assert (len(time) - 1, True) == (len(ordered), bool((np.diff(ordered) > 0).all()))


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_few_samples_make_a_page(samples: int) -> None:
    """A recording may have hardly any settled point."""
    page = report(dataclasses.replace(NAMED, curves=curves(samples)))
    assert ["driver0", "time", "driver1"] == figures(page)
    assert [] == UNKNOWN.findall(page)


def test_empty_curves_draw_nothing() -> None:
    """No sample, or none that was measured."""
    c = curves(5)
    nothing, flags = np.zeros(0), np.zeros(0, dtype=bool)
    none = Curves(
        time=nothing,
        measured=nothing,
        shipped=nothing,
        recalibrated=nothing,
        repaired=nothing,
        heldout=flags,
        drivers={"x": nothing},
        inside=flags,
    )
    unmeasured = dataclasses.replace(c, measured=np.full(5, NAN))
    for empty in (none, unmeasured):
        assert curves_of(dataclasses.replace(NAMED, curves=empty)) is None


def test_medians_follow_the_values() -> None:
    """Parts of the range with too few values have none."""
    x = np.concatenate([np.full(5, 0.0), np.full(2, 12.0), np.full(5, 24.0)])
    centres, medians = middle_by(x, 2.0 * x + 1.0)
    known = np.isfinite(medians)
    assert [0.5, 23.5] == centres[known].tolist()
    assert [1.0, 49.0] == medians[known].tolist()
