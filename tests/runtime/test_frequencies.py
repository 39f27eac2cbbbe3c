"""How often faults come: it decides between explanations that readings cannot tell apart, alone."""

from __future__ import annotations

import dataclasses
import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rulec_runtime import limits
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import RulesetRefused, parse_ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.from_modules import diagnose_results
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.steady.rivals import Other, rivals_of
from rulec_runtime.diagnosis.stores import judge
from rulec_runtime.diagnosis.stores.joined_windows import _cause
from rulec_runtime.diagnosis.trace import trace
from rulec_runtime.live.follower import follow, nothing_yet
from rulec_runtime.live.horizon import Horizon, episodes_of
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.module_results import ModuleResults, read_results
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.report.html_story import told as story
from rulec_runtime.report.json_form import diagnosis_form
from rulec_runtime.report.wording import actions, headline, why_first

from rulec.export.play import played, results_csv
from rulec.passes.pipeline import compile_plant
from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.conftest import ROOT, compiled
from tests.export.plants import codes

LEAK, LOW = "main.leakage", "main.Q.low"
"""No reading of the plant tells them apart."""

ENTRIES = {LEAK: "leakage(pump)", LOW: "slope(Q)"}
SAMPLES = 240


def listed(ruleset: Ruleset | None = None) -> Ruleset:
    """The plant with listed faults alone: two of them are enough here."""
    rules = ruleset or compiled("zema-hydraulic")
    return dataclasses.replace(rules, unlisted=(), unlisted_cells=())


@pytest.fixture(scope="module")
def kb(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the knowledge base, and of the plant."""
    home = tmp_path_factory.mktemp("home")
    shutil.copytree(ROOT / "kb", home / "kb", ignore=shutil.ignore_patterns("effects"))
    shutil.copytree(ROOT / "plants" / "zema-hydraulic", home / "plants" / "zema-hydraulic")
    return home


def with_frequencies(home: Path, words: Mapping[str, str]) -> Ruleset:
    """The plant, compiled where its module type says how often faults come."""
    text = (ROOT / "kb" / "modules" / "pump-set-warm.yaml").read_text(encoding="utf-8")
    for fault, word in words.items():
        entry = f'{{fault: {ENTRIES[fault]}, frequency: {word}, source: "own record of failures"}}'
        assert ENTRIES[fault] in text
        text = text.replace(ENTRIES[fault], entry)
    (home / "kb" / "modules" / "pump-set-warm.yaml").write_text(text, encoding="utf-8")
    return listed(compile_plant(home / "plants" / "zema-hydraulic"))


def said_of(ruleset: Ruleset, words: Mapping[str, str]) -> Ruleset:
    """The same without compiling."""
    faults = (
        dataclasses.replace(f, frequency=words.get(f.id, f.frequency)) for f in ruleset.faults
    )
    return dataclasses.replace(ruleset, faults=tuple(faults))


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
    """A tenth of the flow is lost from a time on."""
    return recorded(listed(), LEAK, "step")


def only(recording: Recording, ruleset: Ruleset) -> Finding:
    (finding,) = diagnose(recording, ruleset).findings
    return finding


def test_the_more_usual_of_two_that_fit_is_named_first(kb: Path, leaking: Recording) -> None:
    """Frequencies swapped: the headline swaps; what each fault measures stays as it was."""
    plain = listed()
    before = only(leaking, plain)
    assert before.probability == pytest.approx(0.5)
    measured = trace(leaking, plain)
    for named, other in ((LEAK, LOW), (LOW, LEAK)):
        rules = with_frequencies(kb, {named: "common", other: "rare"})
        finding = only(leaking, rules)
        assert named == finding.fault.id
        assert [other] == [name for name, _ in finding.alternatives]
        assert finding.probability == pytest.approx(100 / 101)
        assert (finding.since, finding.until) == (before.since, before.until)
        again = trace(leaking, rules)
        assert np.array_equal(measured.degree, again.degree)
        assert np.array_equal(measured.upper, again.upper)
        assert {named} == set(again.verdict) - {"ok", "moving", "unknown"}
        assert "own record of failures" in finding.fault.frequency_origin
        if named == LEAK:
            assert (before.degree, before.lower, before.upper) == (
                finding.degree,
                finding.lower,
                finding.upper,
            )


def test_it_is_said_why_and_what_to_check_for_each(leaking: Recording) -> None:
    """In words, as data, on the page, and in what a watch tells."""
    rules = said_of(listed(), {LOW: "common"})
    diagnosis = diagnose(leaking, rules)
    (finding,) = diagnosis.findings
    leak, low = rules.fault_by_id[LEAK], rules.fault_by_id[LOW]
    (why,) = why_first(rules, finding)
    assert why == (
        "both fit; main.Q.low is more usual, so it is named first "
        "(main.Q.low is common, main.leakage is usual)"
    )
    assert actions(rules, finding) == (
        f"{low.action} (main.Q reads low); or {leak.action} (internal leakage in main)"
    )
    assert "or" not in headline(rules, finding).split()
    (form,) = diagnosis_form(diagnosis)["findings"]
    assert form["why_first"] == [why]
    assert form["action"] == actions(rules, finding)
    assert [leak.action] == [one["action"] for one in form["alternatives"]]
    page = story(diagnosis)
    assert why in page
    assert leak.action in page
    times = np.array([0.0, 300.0])
    sight = Horizon(since=0.0, until=300.0, settled=300.0, usual=0.0, time=times, pause=1)
    assert actions(rules, finding) in {e.action for e in episodes_of(diagnosis, sight)}


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("true", [LEAK, LOW])
def test_what_no_reading_tells_apart_is_told_together(true: str, course: str) -> None:
    """All estimates move alike, at once or slowly: both have the same probability."""
    rules = compiled("zema-hydraulic")
    findings = diagnose(recorded(rules, true, course), rules).findings
    assert findings
    for finding in findings:
        named = {finding.fault.id: finding.probability, **dict(finding.alternatives)}
        assert named[LEAK] == named[LOW]
        told = headline(rules, finding) + actions(rules, finding)
        assert all(rules.fault_by_id[name].action in told for name in (LEAK, LOW))


def test_what_readings_tell_apart_stays(abc: Ruleset) -> None:
    """However rare the fault, and however common all others."""
    recording = read_recording(ROOT / "plants" / "abc" / "examples" / "leakage_A.csv", abc)
    words = {f.id: "rare" if f.id == "A.leakage" else "common" for f in abc.faults}
    plain, weighed = (diagnose(recording, rules) for rules in (abc, said_of(abc, words)))
    assert plain.findings
    for one, other in zip(plain.findings, weighed.findings, strict=True):
        assert (one.fault.id, one.degree, one.lower) == (other.fault.id, other.degree, other.lower)


def test_rivals_stay_rivals_however_rare() -> None:
    """What the readings do not tell from a cause, and what is about as probable."""
    named = Other("a", 0.90, 0.40)
    others = [Other("b", 0.009, 0.40), Other("c", 0.05, 0.01), Other("d", 0.001, 0.01)]
    others.append(Other("e", 0.35, 0.03))
    rivals, remote = rivals_of(named, others)
    assert [name for name, _ in rivals] == ["e", "b"]
    assert [name for name, _ in remote] == ["c"]


def test_a_plant_that_stores_weighs_them_too(abc: Ruleset) -> None:
    """Two faults leave the same of a window; with 2.0 less than ten times as likely, and with 8.0
    more."""
    faults = [abc.fault_by_id["A.leakage"], abc.fault_by_id["A.dp.low"]]
    common = [faults[0], dataclasses.replace(faults[1], frequency="common")]
    for left, first in ((10.0, "A.dp.low"), (12.0, "A.dp.low"), (18.0, "A.leakage")):
        tests = {
            "A.leakage": judge.Tested(0.1, 0.01, 10.0, True),
            "A.dp.low": judge.Tested(0.2, 0.01, left, True),
        }
        nothing, plain = cast(Any, None), cast(Any, SimpleNamespace(chi=99.0))
        one = judge.Judged(nothing, nothing, plain, 9, True, {}, tests)
        assert "A.leakage" == _cause([one], [0], faults).fault
        cause = _cause([one], [0], common)
        assert first == cause.fault
        assert cause.degree == tests[first].degree


def test_the_words_reach_the_ruleset_and_old_ones_go_without(kb: Path) -> None:
    """A word that is none is refused; the schemas know the same words."""
    text = listed().to_json()
    assert "frequency" not in text
    rules = with_frequencies(kb, {LEAK: "rare"})
    data = json.loads(rules.to_json())
    stated = {f["id"]: f["frequency"] for f in data["faults"] if "frequency" in f}
    assert {LEAK: "rare"} == stated
    assert rules == parse_ruleset(data)
    place = [f["id"] for f in data["faults"]].index(LEAK)
    data["faults"][place]["frequency"] = "often"
    with pytest.raises(RulesetRefused, match="no frequency 'often'"):
        parse_ruleset(data)
    for kind, path in (
        ("fault", ("frequency",)),
        ("module", ("faults", "items", "properties", "frequency")),
    ):
        part = json.loads((ROOT / "kb/schema" / f"{kind}.schema.json").read_text("utf-8"))
        part = part["properties"]
        for step in path:
            part = part[step]
        assert part["enum"] == list(limits.FREQUENCY_ODDS)


def test_a_module_type_knows_better_than_the_fault(kb: Path) -> None:
    """What the file of a fault says, of one direction or of all, holds where the module type says
    nothing."""
    file = kb / "kb" / "faults" / "slope.yaml"
    plain = file.read_text(encoding="utf-8")
    high = "excess of the reading over the true value}"
    stated = plain.replace(high, f"{high}, frequency: usual, frequency_source: a bench")
    stated += "frequency: common\nfrequency_source: a survey\n"
    file.write_text(stated, encoding="utf-8")
    try:
        rules = with_frequencies(kb, {LOW: "rare"})
    finally:
        file.write_text(plain, encoding="utf-8")
    words = {f.id: f.frequency for f in rules.faults}
    named = (LOW, LOW.replace(".low", ".high"), "main.dp.low", "main.dp.high", LEAK)
    assert ("rare", "rare", "common", "usual", "usual") == tuple(words[n] for n in named)
    assert "a survey" in rules.fault_by_id["main.dp.low"].frequency_origin
    assert "a bench" in rules.fault_by_id["main.dp.high"].frequency_origin


@pytest.mark.parametrize(("named", "other"), [(LEAK, LOW), (LOW, LEAK)])
def test_beside_the_plant_the_more_usual_is_named_first_too(
    leaking: Recording, named: str, other: str
) -> None:
    """By the watch, in its event, and by what controllers hand over."""
    rules = said_of(listed(), {named: "common", other: "rare"})
    whole = only(leaking, rules)
    events, diagnosis = [], None
    for said in follow(rules, nothing_yet(False), Rows(leaking.time, leaking.values)):
        events += [e.episode for e in said.events if e.episode.kind == "fault"]
        diagnosis = said.diagnosis
    assert diagnosis is not None
    assert diagnosis.findings == (whole,)
    (episode,) = {e.id: e for e in events}.values()
    assert episode.subject == named
    assert [name for name, _ in episode.alternatives] == [other]
    by_modules = results_read(leaking, rules)
    (finding,) = diagnose_results(by_modules, rules).findings
    assert finding.fault.id == named
    assert [name for name, _ in finding.alternatives] == [other]
    assert finding.probability == pytest.approx(whole.probability)


def results_read(recording: Recording, rules: Ruleset) -> ModuleResults:
    """What controllers would hand over of a recording."""
    text = results_csv(played(recording, rules, codes("zema-hydraulic")))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "results.csv")
        file.write_text(text, encoding="utf-8")
        return read_results(file, rules)
