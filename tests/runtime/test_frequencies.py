"""How often faults come: it decides between explanations that readings cannot tell apart, alone."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.fault_frequency import FREQUENCY_ODDS
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import RulesetRefused, parse_ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.from_modules import diagnose_results
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.live.follower import follow
from rulec_runtime.live.memory import nothing_yet
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.module_results import read_results
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.report.html_findings import told as story
from rulec_runtime.report.json_form import diagnosis_form
from rulec_runtime.report.wording import actions, headline, why_first

from rulec.export.play_on_recording import played, results_csv
from rulec.passes.pipeline import compile_plant
from rulec.simulation.equations import equations_of
from rulec.simulation.prediction import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.conftest import ROOT, compiled
from tests.export.plants import codes

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
    values = sense(rules, found.values, SensorErrors(), np.random.default_rng(5), {})
    segment = np.zeros(SAMPLES, dtype=int)
    return Recording(time=TIME, values=values, segment=segment, missing=(), notes=())


@pytest.fixture(scope="module")
def leaking() -> Recording:
    return recorded(listed(compiled(RIG)), LEAK, "step")


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


def test_it_is_said_why_and_what_to_check_for_each(leaking: Recording) -> None:
    rules = said_of(listed(compiled(RIG)), {LOW: "common"})
    diagnosis = diagnose(leaking, rules)
    (finding,) = diagnosis.findings
    leak, low = rules.fault_by_id[LEAK], rules.fault_by_id[LOW]
    (why,) = why_first(rules, finding)
    assert why == (
        "both fit the readings; main.Q.low comes first because it occurs more often "
        "(main.Q.low: common, main.leakage: usual)"
    )
    assert actions(rules, finding) == (
        f"{low.action} (main.Q); or {leak.action} (internal leakage in main)"
    )
    assert "or" not in headline(rules, finding).split()
    (form,) = diagnosis_form(diagnosis)["findings"]
    assert form["why_first"] == [why]
    assert form["action"] == actions(rules, finding)
    assert [leak.action] == [one["action"] for one in form["alternatives"]]
    assert all(words in story(diagnosis) for words in (why, leak.action))


@pytest.mark.parametrize(("true", "course"), [(LEAK, "ramp"), (LOW, "step")])
def test_what_no_reading_tells_apart_is_told_together(true: str, course: str) -> None:
    rules = compiled(RIG)
    findings = diagnose(recorded(rules, true, course), rules).findings
    assert findings
    for finding in findings:
        named = {finding.fault.id: finding.probability, **dict(finding.alternatives)}
        assert named[LEAK] == named[LOW]
        told = headline(rules, finding) + actions(rules, finding)
        assert all(rules.fault_by_id[name].action in told for name in (LEAK, LOW))


def test_what_readings_tell_apart_stays(abc: Ruleset) -> None:
    recording = read_recording(ROOT / "plants" / "abc" / "examples" / "leakage_A.csv", abc)
    words = {f.id: "rare" if f.id == "A.leakage" else "common" for f in abc.faults}
    plain, weighed = (diagnose(recording, rules) for rules in (abc, said_of(abc, words)))
    assert plain.findings
    for one, other in zip(plain.findings, weighed.findings, strict=True):
        assert (one.fault.id, one.degree, one.lower) == (other.fault.id, other.degree, other.lower)


def test_words_reach_the_ruleset_and_a_module_type_knows_better(tmp_path: Path) -> None:
    """What the file of a fault says, of one direction or of all, holds where the module type says
    nothing. A word that is none is refused; the schemas know the same words."""
    shutil.copytree(ROOT / "kb", tmp_path / "kb", ignore=shutil.ignore_patterns("effects"))
    plant = shutil.copytree(ROOT / "plants" / RIG, tmp_path / "plants" / RIG)
    high = "excess of the reading over the true value}"
    for name, old, new, more in (
        ("faults/slope", high, f"{high}, frequency: usual, frequency_source: a bench", SURVEY),
        (
            "modules/pump-set-warm",
            "slope(Q)",
            RECORD,
            "",
        ),
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
        json.loads((ROOT / "kb/schema" / f"{kind}.schema.json").read_text("utf-8"))["properties"]
        for kind in ("fault", "module")
    )
    for part in (fault, module["faults"]["items"]["properties"]):
        assert part["frequency"]["enum"] == list(FREQUENCY_ODDS)


def test_beside_the_plant_the_more_usual_is_named_first_too(
    leaking: Recording, tmp_path: Path
) -> None:
    rules = said_of(listed(compiled(RIG)), {LOW: "common", LEAK: "rare"})
    whole = only(leaking, rules)
    seen = list(follow(rules, nothing_yet(False), Rows(leaking.time, leaking.values)))
    assert seen[-1].diagnosis.findings == (whole,)
    events = [e.episode for told in seen for e in told.events if e.episode.kind == "fault"]
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
