"""How often faults come, and errors that no module lists: what is named first, and what beside."""

import json
import re
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.fault_frequency import FREQUENCY_ODDS
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import RulesetRefused, parse_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.from_modules import diagnose_results
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.module_results import read_results
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.report.wording import actions, headline, why_first

from rulec.export.play_on_recording import played, results_csv
from rulec.export.value_names import listed_undo
from rulec.passes.pipeline import compile_plant
from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.campaign import campaign
from tests.conftest import ROOT, compiled, plain_yaml
from tests.dosing import TABLE_1, operating_points, record
from tests.export.plants import codes
from tests.method.readings import built, recording
from tests.rig.follower.plants import followed
from tests.runtime.sheets import sampled

RECORD = "{fault: slope(Q), frequency: rare, source: a record}"
SURVEY = "frequency: common\nfrequency_source: a survey\n"
RIG = "zema-hydraulic"
LEAK, LOW = "main.leakage", "main.Q.low"
"""No reading of the plant tells them apart."""

SAMPLES = 240


def listed(ruleset: Ruleset) -> Ruleset:
    """The plant with listed faults alone: two of them are enough here."""
    return replace(ruleset, unlisted=(), unlisted_cells=())


def said_of(ruleset: Ruleset, words: Mapping[str, str]) -> Ruleset:
    faults = (replace(f, frequency=words.get(f.id, f.frequency)) for f in ruleset.faults)
    return replace(ruleset, faults=tuple(faults))


TIME = np.arange(float(SAMPLES))
COURSES = {"step": TIME >= 60.0, "ramp": np.clip((TIME - 60.0) / 150.0, 0.0, 1.0)}


def recorded(rules: Ruleset, fault: str, course: str) -> Recording:
    """A tenth of the flow is lost, or not shown, in the end."""
    found = simulate_with(equations_of(rules), {}, {fault: 0.1 * COURSES[course]})
    return sampled(sense(rules, found.values, SensorErrors(), np.random.default_rng(5), {}))


@pytest.fixture(scope="module")
def leaking() -> Recording:
    return recorded(listed(compiled(RIG)), LEAK, "step")


def usual_and_common() -> Diagnosis:
    rules = said_of(listed(compiled(RIG)), {LOW: "common"})
    return diagnose(recorded(rules, LEAK, "step"), rules)


def only(recording: Recording, ruleset: Ruleset) -> Finding:
    (finding,) = diagnose(recording, ruleset).findings
    return finding


def test_the_more_usual_of_two_that_fit_is_named_first(leaking: Recording) -> None:
    plain = listed(compiled(RIG))
    before, measured = only(leaking, plain), trace(leaking, plain)
    assert before.probability == pytest.approx(0.5)
    for named, other in ((LEAK, LOW), (LOW, LEAK)):
        rules = said_of(plain, {named: "common", other: "rare"})
        finding, again = only(leaking, rules), trace(leaking, rules)
        assert (named, [other]) == (finding.fault.id, [name for name, _ in finding.alternatives])
        assert finding.probability == pytest.approx(100 / 101)
        assert (finding.since, finding.until) == (before.since, before.until)
        assert np.array_equal(measured.degree, again.degree)
        assert np.array_equal(measured.upper, again.upper)
        assert {named} == set(again.verdict) - {"ok", "moving", "unknown"}
        bounds = [(f.degree, f.lower, f.upper) for f in (before, finding)]
        assert named == LOW or bounds[0] == bounds[1]


@pytest.mark.parametrize(("true", "course"), [(LEAK, "ramp"), (LOW, "step")])
def test_what_no_reading_tells_apart_is_told_together(true: str, course: str) -> None:
    rules = compiled(RIG)
    findings = diagnose(recorded(rules, true, course), rules).findings
    assert findings
    for finding in findings:
        named = {finding.fault.id: finding.probability, **dict(finding.alternatives)}
        assert named[LEAK] == named[LOW]
        text = headline(rules, finding) + actions(rules, finding)
        assert all(rules.fault_by_id[name].action in text for name in (LEAK, LOW))


def test_what_readings_tell_apart_stays(abc: Ruleset) -> None:
    recording = read_recording(ROOT / "plants" / "abc" / "examples" / "leakage_A.csv", abc)
    words = {f.id: "rare" if f.id == "A.leakage" else "common" for f in abc.faults}
    plain, weighed = (diagnose(recording, rules) for rules in (abc, said_of(abc, words)))
    assert plain.findings
    for one, other in zip(plain.findings, weighed.findings, strict=True):
        assert (one.fault.id, one.degree, one.lower) == (other.fault.id, other.degree, other.lower)


def test_words_reach_the_ruleset_and_a_module_type_knows_better(tmp_path: Path) -> None:
    """The file of a fault counts where the module type says nothing."""
    shutil.copytree(ROOT / "kb", tmp_path / "kb", ignore=shutil.ignore_patterns("effects"))
    plant = shutil.copytree(ROOT / "plants" / RIG, tmp_path / "plants" / RIG)
    high = "excess of the reading over the true value}"
    usual = f"{high}, frequency: usual, frequency_source: a bench"
    for name, old, new, more in (
        ("faults/slope", high, usual, SURVEY),
        ("modules/pump-set-warm", "slope(Q)", RECORD, ""),
    ):
        file = tmp_path / "kb" / f"{name}.yaml"
        text = file.read_text(encoding="utf-8")
        assert old in text
        file.write_text(text.replace(old, new) + more, encoding="utf-8")
    rules = listed(compile_plant(plant))
    words = {f.id: f.frequency for f in rules.faults}
    named = (LOW, LOW.replace(".low", ".high"), "main.dp.low", "main.dp.high", LEAK)
    assert ("rare", "rare", "common", "usual", "usual") == tuple(words[n] for n in named)
    for one, origin in ((LOW, "a record"), (named[2], "a survey"), (named[3], "a bench")):
        assert origin in rules.fault_by_id[one].frequency_origin
    data = json.loads(rules.to_json())
    assert rules == parse_ruleset(data)
    assert "frequency" not in listed(compiled(RIG)).to_json()
    data["faults"][0]["frequency"] = "often"
    with pytest.raises(RulesetRefused, match="no frequency 'often'"):
        parse_ruleset(data)
    fault, module = (
        plain_yaml(ROOT / "kb/schema" / f"{kind}.schema.json")["properties"]
        for kind in ("fault", "module")
    )
    for part in (fault, module["faults"]["items"]["properties"]):
        assert part["frequency"]["enum"] == list(FREQUENCY_ODDS)


def test_beside_the_plant_the_more_usual_is_named_first_too(
    leaking: Recording, tmp_path: Path
) -> None:
    rules = said_of(listed(compiled(RIG)), {LOW: "common", LEAK: "rare"})
    whole = only(leaking, rules)
    told = followed(rules, leaking, len(leaking))
    assert told.diagnosis.findings == (whole,)
    events = [e.episode for e in told.events if e.episode.kind == "fault"]
    (episode,) = {e.id: e for e in events}.values()
    file = tmp_path / "results.csv"
    by_controllers = results_csv(played(leaking, rules, codes(RIG)))
    file.write_text(by_controllers, encoding="utf-8")
    (finding,) = diagnose_results(read_results(file, rules), rules).findings
    assert (LOW, LOW) == (episode.subject, finding.fault.id)
    assert actions(rules, whole) == episode.action
    for found in (episode, finding):
        assert [LEAK] == [name for name, _ in found.alternatives]
    assert finding.probability == pytest.approx(whole.probability)


SOUND = 10
"""Samples before a reading is off."""


def misread(signal: str, points: int, share: float = 0.0, size: float = 0.0) -> Diagnosis:
    """One reading is off after some samples; several operating points, or the first alone."""
    rules, plant = compiled("abc"), built("abc")
    visited = operating_points(plant, 5)[:points]
    (case,) = campaign(plant, [{}], [visited], 11, SOUND)
    made = record(case.run, TABLE_1, case.seed).readings
    (column,) = (name for name in made if name.split()[0] == signal)
    off = np.array(made[column])
    off[SOUND:] = off[SOUND:] * (1.0 + share) + size
    return diagnose(recording(rules, {**made, column: off}), rules)


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
    (finding,) = misread(signal, 5, share, size).findings
    assert fault == finding.fault.id
    assert finding.fault.unlisted
    assert finding.lower <= abs(share + size) <= finding.upper


@pytest.mark.parametrize(("signal", "size"), [("A.dp", 0.3), ("A.P_el", 40.0)])
def test_both_are_named_where_no_reading_tells(signal: str, size: float) -> None:
    """At one operating point a share and a size are the same; what the module lists comes first."""
    (finding,) = misread(signal, 1, 0.0, size).findings
    assert f"{signal}.high" == finding.fault.id
    assert f"{signal}.offset.high" in dict(finding.alternatives)
    said = " ".join(why_first(compiled("abc"), finding))
    assert f"{signal}.high: usual; " in said or f"{signal}.high: rare; " in said
    assert re.search(rf"{signal}\.offset\.high: \w+, not listed by its module", said)


def test_a_speed_too_high_is_no_leakage_alone() -> None:
    for share in (0.1, 0.3):
        (finding,) = misread("A.n", 1, share).findings
        assert "A.n.high" in {finding.fault.id, *dict(finding.alternatives)}


def test_what_a_ruleset_lists() -> None:
    """An old ruleset without them reads as before."""
    rules = compiled("abc")
    listed, others = ({f.id for f in faults} for faults in (rules.faults, rules.unlisted))
    assert {"A.dp.high", "A.P_el.low"} <= listed
    assert {"A.n.high", "A.n.low", "A.dp.offset.high", "C.dp.offset.low"} <= others
    assert not listed & others
    assert all(f.odds < 1.0 for f in rules.unlisted)
    data = json.loads(rules.to_json())
    del data["unlisted"], data["unlisted_cells"], data["digest"]
    assert parse_ruleset(data).unlisted == ()


def test_controllers_undo_listed_faults_alone() -> None:
    rules = compiled("abc")
    inverse = listed_undo(rules)
    assert not {f"x:{f.id}" for f in rules.unlisted} & set(inverse.inputs)
    given = {s.id: s.reference for s in rules.signals}
    given |= {f"x:{name}": 0.1 * (name == "A.leakage") for name in rules.fault_by_id}
    whole, part = rules.undo.run(given), inverse.run(given)
    assert all(whole[name] == pytest.approx(value, rel=1e-12) for name, value in part.items())
