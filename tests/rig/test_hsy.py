"""Waste-water pumps against their data sheets, by a recording without labels."""

from rulec_runtime.diagnosis.diagnose import diagnose

from tests.conftest import compiled, recordings_folder
from tests.rig import real
from tests.rig.hsy import FILE, PLANT, recorded, settled_of


def test_diagnose_finds_rags_not_the_tolerance_of_the_sheet() -> None:
    """393 of 1536 samples are judged: a start, stop or step of any pump ends a stretch for all, and
    samples in which a reading still settles are left out. Found are pumps 1.4 and 2.4, and smaller
    ones that come and go in 2.1 and 1.2: head and power are wrong together, which flow lost inside
    the pump explains, or a flow meter that reads low. Nothing is left unexplained, and nothing is
    told of pump 1.3, which never ran."""
    real(str(FILE))
    recording = recorded(recordings_folder())
    settled, diagnosis = settled_of(recording), diagnose(recording, compiled(PLANT))
    assert (1536, 393) == (len(settled), int(settled.sum()))
    assert (393, ()) == (diagnosis.judged, diagnosis.unknown)
    causes = [{f.fault.id, *(name for name, _ in f.alternatives)} for f in diagnosis.findings]
    pumps = [{f"{pump}.recirculation", f"{pump}.Q.low"} for pump in ("P14", "P24", "P12")]
    assert [pumps[0], {"P21.recirculation"}, *pumps[1:]] == causes
