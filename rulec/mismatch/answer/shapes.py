"""From a curve that was found to a shape as shown, with what it says of memory and of rivals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec.effects.candidate import TIME
from rulec.mismatch import limits as common
from rulec.mismatch.answer import limits
from rulec.mismatch.answer.shape_words import Drawable, memory_words, shape_words, turns_of
from rulec.mismatch.evidence.model import Model, Variable
from rulec.mismatch.result import Beaten, Region, Shape
from rulec.mismatch.search.curve_found import Branches, CurveFound, Lost

TOO_FEW = "its driver did not come from both sides often enough"

NO_CLOCK = "there is no common time, so which way the driver came is not known"

OVER_TIME = "it was looked at over time alone"


def shape_of(model: Model, found: CurveFound) -> Shape | None:
    """The shape in the units of its place and of its driver; None where that is not recorded."""
    driver = _variable(model, found.driver)
    if driver is None:
        return None
    factor = found.place.factor
    curve, level = _from_its_level(
        Drawable(
            at=driver.shown(found.at),
            value=found.value / factor,
            covariance=found.covariance / factor**2,
            driver_unit=driver.unit,
            unit=found.place.unit,
        )
    )
    text, monotone = shape_words(curve)
    memory, because = _memory(model, found)
    means = np.column_stack([driver.shown(found.means[:, 0]), found.means[:, 1:] / factor])
    means[:, 1] -= level
    return Shape(
        driver=found.driver,
        driver_unit=driver.unit,
        unit=found.place.unit,
        at=curve.at,
        value=curve.value,
        u=np.sqrt(np.maximum(np.diag(curve.covariance), 0.0)),
        means=means,
        text=text,
        monotone=monotone,
        memory=memory,
        memory_text=because,
        beaten=tuple(_beaten(lost, found.driver, driver) for lost in found.lost),
    )


def _from_its_level(curve: Drawable) -> tuple[Drawable, float]:
    """A curve from the level at which it begins, and that level.

    A level alone is a matter of calibration, and its doubt says nothing of the shape.
    """
    begin = next(iter(turns_of(curve)), None)
    near = np.ones(len(curve.at), dtype=bool)
    if begin is not None:
        off = np.abs(curve.value - curve.value[begin])
        near = off <= limits.CURVE_FLAT * float(np.ptp(curve.value))
    weights = near / near.sum()
    less = np.eye(len(near)) - weights
    moved = replace(curve, value=less @ curve.value, covariance=less @ curve.covariance @ less.T)
    return moved, float(weights @ curve.value)


def _variable(model: Model, name: str) -> Variable | None:
    if name == TIME:
        return Variable(model.samples.time, 1.0, 0.0, "s")
    return model.variable(name)


def _memory(model: Model, found: CurveFound) -> tuple[str, str]:
    """Does it matter which way the driver came? Yes and no need both to be sure."""
    branches = found.branches
    if branches is None:
        if found.driver == TIME:
            return "cannot be told", OVER_TIME
        return "cannot be told", TOO_FEW if model.samples.timed else NO_CLOCK
    factor, height = found.place.factor, float(np.ptp(found.value))
    words = memory_words(
        branches.gap / factor,
        branches.u / abs(factor),
        found.place.unit,
        (branches.rising, branches.falling),
    )
    return answer_of(branches, height), words


def answer_of(branches: Branches, height: float) -> str:
    """Yes or no where either is sure: whether a gap counts beside the height of a curve."""
    gap, least = abs(branches.gap), limits.BRANCHES_COUNT * height
    if gap > limits.BRANCHES_CLEAR * branches.u and gap > least:
        return "yes"
    return "no" if gap + common.NORMAL_95 * branches.u < least else "cannot be told"


def _beaten(lost: Lost, name: str, driver: Variable) -> Beaten:
    candidate, region = lost.candidate, None
    if lost.between is not None:
        low, high = (None if end is None else float(driver.shown(end)) for end in lost.between)
        region = Region(name, low, high, driver.unit, lost.share)
    return Beaten(candidate.name, candidate.title, lost.nats, region)
