"""Any reading may be off, whatever its module lists: plant abc, made by the independent truth."""

from __future__ import annotations

import json

import numpy as np
import pytest
from rulec_runtime.contract.ruleset_file import parse_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.report.wording import why_first

from rulec.commands.matrix import json_form
from rulec.export.value_names import listed_undo
from rulec.prove.truth import TABLE_1, operating_points, record
from tests.campaign import campaign
from tests.conftest import compiled
from tests.method.readings import built, recording

SOUND = 10
"""Samples before a reading is off."""


def misread(signal: str, points: int, share: float = 0.0, size: float = 0.0) -> Diagnosis:
    """A sound plant, of which one reading is off by a share or a size, in its unit, after some
    samples; several operating points, or the first alone."""
    rules, plant = compiled("abc"), built("abc")
    visited = operating_points(plant, 5)[:points]
    (case,) = campaign(plant, [{}], [visited], 11, SOUND)
    made = record(case.run, TABLE_1, case.seed).readings
    (column,) = (name for name in made if name.split()[0] == signal)
    off = np.array(made[column])
    off[SOUND:] = off[SOUND:] * (1.0 + share) + size
    return diagnose(recording(rules, {**made, column: off}), rules)


def only(diagnosis: Diagnosis) -> Finding:
    (finding,) = diagnosis.findings
    return finding


@pytest.mark.parametrize(
    ("signal", "share", "size", "fault"),
    [
        ("A.n", 0.1, 0.0, "A.n.high"),
        ("B.n", -0.2, 0.0, "B.n.low"),
        ("A.dp", 0.0, 0.3, "A.dp.offset.high"),
        ("B.dp", 0.0, -0.3, "B.dp.offset.low"),
        ("A.P_el", 0.0, 40.0, "A.P_el.offset.high"),
    ],
)
def test_it_is_named_where_points_differ(
    signal: str, share: float, size: float, fault: str
) -> None:
    """At five operating points no listed fault looks like it; bounds hold what was done."""
    finding = only(misread(signal, 5, share, size))
    assert fault == finding.fault.id
    assert finding.fault.unlisted
    assert finding.lower <= abs(share + size) <= finding.upper


@pytest.mark.parametrize(("signal", "size"), [("A.dp", 0.3), ("A.P_el", 40.0)])
def test_both_are_named_where_no_reading_tells(signal: str, size: float) -> None:
    """At one operating point a share and a size are the same; what the module lists comes first."""
    finding = only(misread(signal, 1, 0.0, size))
    assert f"{signal}.high" == finding.fault.id
    assert f"{signal}.offset.high" in dict(finding.alternatives)
    said = " ".join(why_first(compiled("abc"), finding))
    assert f"{signal}.offset.high: not listed by its module" in said


def test_a_speed_too_high_is_no_leakage_alone() -> None:
    for share in (0.1, 0.3):
        finding = only(misread("A.n", 1, share))
        assert "A.n.high" in {finding.fault.id, *dict(finding.alternatives)}


def test_what_a_ruleset_lists() -> None:
    """What a module lists is not there twice, and each error of a class is there once; an old
    ruleset without them reads as before."""
    rules = compiled("abc")
    listed, others = ({f.id for f in faults} for faults in (rules.faults, rules.unlisted))
    assert {"A.dp.high", "A.P_el.low"} <= listed
    assert {"A.n.high", "A.n.low", "A.dp.offset.high", "C.dp.offset.low"} <= others
    assert not listed & others
    assert all(f.odds < 1.0 for f in rules.unlisted)
    data = json.loads(rules.to_json())
    del data["unlisted"], data["unlisted_cells"], data["digest"]
    assert parse_ruleset(data).unlisted == ()


def test_the_matrix_folds_them_into_a_row_for_each_reading() -> None:
    rules = compiled("abc")
    readings = ("A.n", "A.dp", "A.P_el", "B.n", "B.dp", "B.P_el", "C.dp")
    assert readings == tuple(rules.moved_by_reading)
    form = json_form(rules)["unlisted"]
    assert [f.id for f in rules.unlisted] == form["faults"]
    assert all(any(row) for row in form["signs"])


def test_controllers_undo_listed_faults_alone() -> None:
    rules = compiled("abc")
    undo = listed_undo(rules)
    assert not {f"x:{f.id}" for f in rules.unlisted} & set(undo.inputs)
    given = {s.id: s.reference for s in rules.signals}
    given |= {f"x:{name}": 0.1 * (name == "A.leakage") for name in rules.fault_by_id}
    whole, part = rules.undo.run(given), undo.run(given)
    assert all(whole[name] == pytest.approx(value, rel=1e-12) for name, value in part.items())
