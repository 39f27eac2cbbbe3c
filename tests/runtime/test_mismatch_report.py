"""The report of a comparison: sound, self-contained, computed from what it shows."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from rulec_runtime.report.text import number

from rulec.mismatch.answer.terminal_and_page import ReadingCourses, curves_of, rms
from rulec.mismatch.result import Mismatch, Region
from tests.runtime.mismatches import ALL, FAULT, NAMED, NAN, broken, curves, spoken
from tests.runtime.pages import mismatch_page as report
from tests.runtime.reports import NEEDS_MORE, NO_NUMBER, caption, figures, tree

USUAL = ("time", "driver0", "driver1")
DRIVER_FIRST = ("driver0", "time", "driver1")
VERDICTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "named": ("◆ M", DRIVER_FIRST),
    "ambiguous": ("▲ S", DRIVER_FIRST),
    "fault": ("✖ F", USUAL),
    "sensor": ("✖ F", USUAL),
    "unnamed": ("▲ S", (*DRIVER_FIRST, "hidden")),
    "none": ("✓ ok", USUAL),
    "cannot judge": ("▼ C", ()),
}
"""Symbol and letter, which say it without colour; and figures, what it depends on first."""


def drawn(mismatch: Mismatch) -> ReadingCourses:
    found = curves_of(mismatch)
    assert found is not None
    return found


@pytest.mark.parametrize("case", ALL)
def test_every_verdict_gives_a_sound_page(case: str) -> None:
    """Well-formed, asking for nothing else, without NaN also where no number is known."""
    for mismatch in (ALL[case], broken(ALL[case])):
        page = report(mismatch)
        badge = tree(page).find(".//header//span")
        assert badge is not None
        assert VERDICTS[case][0] == badge.text
        assert [] == NO_NUMBER.findall(page) + NEEDS_MORE.findall(page)
    assert list(VERDICTS[case][1]) == figures(report(ALL[case]))


def test_hostile_texts_stay_text() -> None:
    """They come out as written, never as markup."""
    page = tree(report(spoken("<script src='//x'>\"&\u202e\x07</script>")))
    assert [] == [*page.iter("script"), *page.iter("img")]
    assert "<script src='//x'>\"&\ufffd\ufffd</script>" == page.findtext(".//h1")


def test_captions_are_computed() -> None:
    """From the curves alone: over the temperature the median error spans much before the repair and
    little after it; errors over time inside the located region and outside it, which is shaded."""
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
    """Inside all regions of a location; by its periods where no region can be drawn."""
    time, warm = curves().time, curves().drivers["A.T [degC]"]
    np.testing.assert_array_equal(warm >= 45.0, drawn(NAMED).located)
    periods = (time <= 25.0) | ((time >= 200.0) & (time <= 225.0))
    strange = Region("B.T", 45.0, None, "degC", 1.0)
    elsewhere = dataclasses.replace(FAULT.locations[0], region=(strange,))
    for mismatch in (FAULT, dataclasses.replace(FAULT, locations=(elsewhere,))):
        np.testing.assert_array_equal(periods, drawn(mismatch).located)


def test_points_in_faults_do_not_count() -> None:
    """They are drawn, but neither captions nor clouds know them."""
    c = curves()
    measured = np.where(c.time < 100, 0.0, c.measured)
    faulty = dataclasses.replace(c, measured=measured, inside=c.time >= 100)
    found = drawn(dataclasses.replace(NAMED, curves=faulty))
    error = found.error("repaired")
    assert rms((c.measured - c.repaired)[100:]) == rms(error[np.isfinite(error)])
    assert 0.0 == found.curves.measured[0]


@pytest.mark.parametrize("samples", [1, 2, 3, 100_000])
def test_any_number_of_samples_makes_a_page(samples: int) -> None:
    """Hardly any settled point, or so many that they are thinned to half a megabyte."""
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
