"""Waste-water pumps against their data sheets: figures that must not get worse, and honest ones.

There are no labels. What can be shown: degrees change where something happens to a pump (rags while
it runs, a stop).
"""

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.isolate import alarm_chance, quantile

from tests.conftest import compiled, recordings_folder
from tests.rig import real
from tests.rig.hsy import FILE, PLANT, PUMPS, Station, beyond_the_sheet, judge, while_running


@pytest.fixture(scope="module")
def station() -> Station:
    """The station, every sample judged."""
    real(str(FILE))
    return judge(recordings_folder())


def test_what_is_judged(station: Station) -> None:
    """407 of 1536 samples; a start, stop or step of any pump ends a stretch for all, and samples
    in which a reading still settles are left out. Pump 1.3 never ran, so it gets no degree."""
    assert (1536, 407) == (len(station.settled), int(station.settled.sum()))
    judged = np.isfinite(station.judged("excess-power").value).any(axis=1)
    assert ["P13"] == [p for p, ok in zip(PUMPS, judged, strict=True) if not ok]


@pytest.mark.parametrize("fault", ["missing-head", "excess-power"])
def test_a_pump_gets_worse_while_it_runs_and_better_by_a_stop(station: Station, fault: str) -> None:
    """Rags: a rise in 37 of 39 long runs, a fall over 19 of the 23 stops that follow."""
    grown, fallen = while_running(station, fault)
    assert (37, 39) == (int(np.sum(np.array(grown) > 0)), len(grown))
    assert (19, 23) == (int(np.sum(np.array(fallen) < 0)), len(fallen))


def test_what_is_proven_against_the_sheet(station: Station) -> None:
    """Pump 1.4 draws too much on each of its ten days; 1.1, 2.1 and 2.4 on none. The largest excess
    of a day, 14.8 % in 1.4, is 3.2 standard uncertainties: enough for that one question, too little
    where 56 faults are tried on 64 stretches (5.4)."""
    judged = station.judged("excess-power")
    found = beyond_the_sheet(judged)
    assert (10, 10) == found["P14"]
    assert [0, 0, 0] == [found[p][0] for p in ("P11", "P21", "P24")]
    with np.errstate(invalid="ignore"):
        largest = np.nanmax(judged.daily() / judged.daily_u())
    faults = len(compiled(PLANT).faults)
    needed = quantile(alarm_chance(station.stretches) / (2 * faults))
    assert (64, 56) == (station.stretches, faults)
    assert (3.2, 5.4) == (round(float(largest), 1), round(needed, 1))


def test_diagnose_finds_rags_not_the_tolerance_of_the_sheet(station: Station) -> None:
    """Pumps 1.4 and 2.4, on two occasions each, and smaller ones that come and go in 2.1 and 1.2:
    head and power are wrong together, which flow lost inside the pump explains, or a flow meter
    that reads low. Nothing is left unexplained."""
    diagnosis = diagnose(station.recording, compiled(PLANT))
    assert (407, ()) == (diagnosis.judged, diagnosis.unknown)
    pumps = ("P14", "P24", "P14", "P21", "P24", "P12")
    assert [f"{pump}.recirculation" for pump in pumps] == [f.fault.id for f in diagnosis.findings]
    rivals = [{n for n, _ in f.alternatives} for f in diagnosis.findings if f.probability < 0.9]
    assert [{"P14.Q.low"}, {"P24.Q.low"}] * 2 == rivals
