"""What the three models predict, as a table, and the spans that were held out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.written import written
from rulec.mismatch.evidence.stores.final_fits import plain_end
from rulec.mismatch.inference.series import course_of, heldout_spans, series_csv
from rulec.mismatch.result import Course, Series
from tests.runtime.mismatch.dynamic.benches import bench, explained, made
from tests.runtime.mismatch.made import columns
from tests.runtime.mismatches import CANNOT_JUDGE, NAMED

NAN = float("nan")
THREE = np.array([0.0, 1.0, 2.0])


def test_a_cell_without_value_is_empty() -> None:
    """Columns in the agreed order, each with its unit. Without a split there is a head."""
    own = {"measured": np.array([1.0, NAN, 3.0]), "repaired": np.array([NAN, 1, 2])}
    course = Course(signal="A.Q", unit="l/h", shipped=THREE, recalibrated=THREE, **own)
    table = series_csv(Series(THREE, np.array([False, True, False]), (course,)))
    assert [
        "time [s],heldout [1],A.Q measured [l/h],A.Q shipped [l/h],A.Q recalibrated [l/h],"
        "A.Q repaired [l/h]",
        "0,0,1,0,0,",
        "1,1,,1,1,1",
        "2,0,3,2,2,2",
    ] == table.splitlines()
    assert "time [s],heldout [1]\n" == series_csv(CANNOT_JUDGE.series)
    assert [] == mismatch_form(CANNOT_JUDGE, "x")["split"]["heldout"]


def test_plants_that_store_have_the_same_table() -> None:
    """No residual is solved there; errors follow from the table all the same."""
    recording = made(n=256)
    place = bench(recording)
    ends, plain = plain_end(place, {})
    said = explained(recording, place, ends, plain, plain)
    proofs = said.proofs(())
    (reading,) = said.readings(None, written(said, proofs)[0], proofs)
    signal = place.ruleset.signal_by_id[reading.fit.signal]
    course = course_of(signal, reading.measured, reading.predicted)
    series = Series(place.record.time, ~place.record.open, (course,))
    found = replace(NAMED, series=series, fits=(reading.fit,))
    table, [fit] = columns(found), found.fits
    error = table["lower.y recalibrated [V]"] - table["lower.y measured [V]"]
    rms = np.sqrt(np.nanmean(error[table["heldout [1]"] == 1] ** 2))
    assert pytest.approx(fit.heldout.recalibrated, rel=1e-4) == rms
    assert fit.relation is None
    assert 5 == len(mismatch_form(found, "x")["split"]["heldout"])


def test_ends_belong_to_their_spans() -> None:
    """A sample at either end, one sample alone, none, all; as in the machine form."""
    assert [(-0.5, 0.5), (1.5, 2.5)] == heldout_spans(THREE, [True, False, True])
    assert [] == heldout_spans(THREE, [False] * 3)
    assert [(4.0, 4.0)] == heldout_spans(np.array([4.0]), [True])
    found = replace(NAMED, series=Series(THREE, np.array([False, True, True])))
    assert [[0.5, 2.5]] == mismatch_form(found, "x")["split"]["heldout"]
