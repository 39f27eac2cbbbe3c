"""What has no name in a plant that stores: its shape, where the catalogue lacks the right entry."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.stores.fit import plain_end
from rulec.mismatch.evidence.stores.fitted_curve import FittedCurve, fitted_curve
from rulec.mismatch.search.curve_by_simulation import curve_of
from rulec.mismatch.search.curve_found import CurveFound
from rulec.mismatch.search.simulated import likeliest_curve
from tests.conftest import ROOT
from tests.runtime.mismatch.dynamic.benches import TRUE, bench, made, searched, tanks

SAMPLES = 640
FLAP = "lower.sticking-flap@outflow"
HELD_BACK, NEAR, WIDE = 0.3, 0.10, 0.025
EFFECT = """
effect: sticking-flap
title: Flap that sticks at some level
sort: physics
joins:
  - {flows: out, law: law*(1 - w*exp(-((l - l0)/d)**2))}
drivers:
  l: {quantity: level}
parameters:
  w:  {unit: "%", null: 0, starts: [10], range: [-100, 100],
       usual: {median: 10, factor: 3, source: "[assumed]"}, title: share held back}
  l0: {unit: cm, starts: [10], range: [1, 40], title: level}
  d:  {unit: cm, starts: [2], range: [0.5, 10], title: width}
regime: some levels
text: "{module}: {w} of what flows out is held back near {l0}, {d}"
action: mend the flap
source: "[assumed]"
"""
LAW = "lower.outlet-exponent@outflow"


@pytest.fixture
def thin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A knowledge base of few effects, with the flap."""
    kb = tmp_path / "kb"
    shutil.copytree(ROOT / "kb", kb)
    for file in (kb / "effects").glob("*.yaml"):
        if file.stem not in ("outlet-exponent", "pump-roll-off"):
            file.unlink()
    (kb / "effects" / "sticking-flap.yaml").write_text(EFFECT.lstrip(), encoding="utf-8")
    monkeypatch.setenv("RULEC_KB", str(kb))
    tanks.cache_clear()
    yield kb
    tanks.cache_clear()


def flapping(kb: Path, seed: int) -> Recording:
    """A recording with the flap, after which the catalogue lacks it."""
    values = {f"{FLAP}.w": HELD_BACK, f"{FLAP}.l0": NEAR, f"{FLAP}.d": WIDE}
    recording = made(SAMPLES, seed, joined=(FLAP,), more=values)
    (kb / "effects" / "sticking-flap.yaml").unlink()
    tanks.cache_clear()
    return recording


def left_out(curve: CurveFound, found: FittedCurve) -> Array:
    """What the plain law leaves out, SI, in a model with its scale of the level: all that a sensor
    of unknown gain and zero says of it is what it shows."""
    values = found.fitted.values
    gain, zero, area = (values[f"lower.{name}"] for name in ("g", "y0", "A"))
    shown = curve.at
    level = (shown - TRUE["lower.y0"]) / TRUE["lower.g"]
    flow = TRUE["lower.a"] * np.sqrt(2.0 * 9.81 * level)
    flow *= 1.0 - HELD_BACK * np.exp(-(((level - NEAR) / WIDE) ** 2))
    flow *= (area * TRUE["lower.g"]) / (TRUE["lower.A"] * gain)
    law = values["lower.a"] * np.sqrt(2.0 * 9.81 * np.maximum((shown - zero) / gain, 0.0))
    off: Array = flow - law
    return off


@pytest.mark.parametrize("seed", [1, 2])
def test_the_true_curve_lies_in_the_band(thin: Path, seed: int) -> None:
    """Over what was shown, with and without its level: the whole curve, by chi-square."""
    place = bench(flapping(thin, seed))
    ends, plain = plain_end(place, {})
    spot = next(s for s in place.builder.spots if s.id == "definition:lower.outflow")
    term = fitted_curve(ends, plain, spot, "lower.h")
    curve = curve_of(term)
    assert "lower.y" == curve.driver
    off = curve.value - left_out(curve, term)
    less = np.eye(len(off)) - 1.0 / len(off)
    u = np.sqrt(np.diag(less @ curve.covariance @ less))
    # A curve of some eight independent values: 99 of 100 are within this, by chi-square.
    assert np.sqrt(np.mean(off**2 / np.diag(curve.covariance))) < np.sqrt(20.1 / 8.0)
    assert np.sqrt(np.mean((less @ off / u) ** 2)) < np.sqrt(20.1 / 8.0)
    # And the band says something: the bump is many times as high.
    assert np.ptp(curve.value) > 5.0 * float(np.median(u))


def test_place_and_driver_are_found(thin: Path) -> None:
    """Among all places and all that they may follow; no curve is drawn through noise."""
    assert likeliest_curve(searched(bench(made(SAMPLES, 1)), LAW)) is None
    unnamed = likeliest_curve(searched(bench(flapping(thin, 1)), LAW))
    curve = unnamed.curve
    # What flows out is all that its balance loses, so these two are the same.
    assert f"{curve.place.module}.{curve.place.place}" in ("lower.outflow", "lower.h")
    assert "lower.y" == curve.driver
    assert unnamed.share > 0.9
    assert abs(curve.branches.gap) < 0.05 * float(np.ptp(curve.value))
    (lost,) = curve.lost
    assert "outlet-exponent" == lost.candidate.name
    assert lost.nats > 100.0
