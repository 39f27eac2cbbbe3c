"""A second round: further recordings of the same true plant, and what is told of them."""

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rulec_runtime.output.terminal import Terminal
from rulec_runtime.report.parts import tell

from rulec.engines.call import Engine
from rulec.prove import second_round
from rulec.prove.analyst import FIRST, FORM, PLAN, ROUND
from rulec.prove.campaign import Campaign, Changed, Workers, folder_of
from rulec.prove.partition import Partition
from rulec.prove.results import ARMS, Further, Run
from rulec.prove.second_round import asked_again, dated, judged_again, run_again, samples_of
from rulec.prove.second_round_table import after_of, further_of, gained, right_set, tables_of_rounds
from rulec.prove.truth.settled import further_recording
from rulec.prove.truth.settled.further_recording import displayed, held, longer, repeated
from rulec.prove.truth.settled.plan import Planned, SettledCase
from rulec.prove.truth.settled.solve import Stalled
from tests.prove.made import LEAK, judged, planted, sealed


@pytest.fixture(scope="module")
def fault() -> SettledCase:
    """A leak that lasts to the end, or not."""
    return Planned("a leak", "fault", "dosing", "steps", ("leak",), aim=300.0, small=True).make()


def recipe_for(case: SettledCase) -> dict[str, Any]:
    """Two steps of 12 s and 9 s at the lowest and highest set points."""
    sensors, steps = case.scene.rig.sensors, []
    for end, begin, until in (("min", 0.0, 12.0), ("max", 12.0, 21.0)):
        at = {n: float(getattr(case.scene.given[n], end)()) for n in case.scene.rig.inputs}
        inputs = {
            n: {"value": displayed(case, n, value), "unit": sensors[n].unit}
            for n, value in at.items()
        }
        steps.append({"from": begin, "until": until, "inputs": inputs})
    return {"steps": steps, "certainty": [0.6, 0.8, 0.95], "factors": [[0.0, 3.0], [3.0, 0.0]]}


def test_a_further_recording_is_of_the_same_plant(fault: SettledCase) -> None:
    """Its first part is the recording that was; lasting errors of sensors stay, noise is new, and
    what was planted is as large."""
    scene = fault.scene
    on = longer(scene, repeated(scene, 400))
    assert on.shaping == slice(scene.time.size)
    assert on.length == scene.length
    for name, values in scene.plain.items():
        assert on.plain[name][on.shaping] == pytest.approx(values, rel=1e-9)
        assert len(on.plain[name]) == scene.time.size + 400
    before = scene.recorded(scene.truly(fault.terms), fault.terms)
    again = further_recording.recorded_further(
        fault, repeated(scene, scene.time.size - scene.first)
    )
    assert again["time [s]"][0] == before["time [s]"][-1] - before["time [s]"][scene.first] + 1.0
    for name in scene.rig.inputs:
        header = f"{name} [{scene.rig.sensors[name].unit}]"
        off = again[header] - before[header][scene.first :]
        noise = 0.3 * 0.5 * scene.rig.sensors[name].bound
        assert abs(off.mean()) < 5.0 * noise * np.sqrt(2.0 / off.size)
        assert off.std() == pytest.approx(noise * np.sqrt(2.0), rel=0.3)


def courses(case: SettledCase, recipe: dict[str, Any], arm: str) -> dict[str, np.ndarray]:
    """Courses of all inputs in a further recording, SI."""
    if arm == "same":
        return repeated(case.scene, sum(samples_of(recipe, 1.0)))
    points, samples = zip(*second_round.steps_of(case, recipe, arm, seed=1), strict=True)
    return held(case, points, samples)


def test_steps_at_which_the_plant_cannot_run_are_left_out(
    fault: SettledCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The others are run; where none can be run, that is said."""
    recipe, run = recipe_for(fault), second_round.recorded_further
    slowest = fault.scene.given["A.n"].min()

    def stalls(case: SettledCase, courses: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        if (courses["A.n"] < slowest * least).any():
            raise Stalled("too slow")
        return run(case, courses)

    monkeypatch.setattr(second_round, "recorded_further", stalls)
    least = 0.5
    assert len(run_again(fault, recipe, "recipe", 1)["time [s]"]) == 21
    least = 1.01
    assert len(run_again(fault, recipe, "recipe", 1)["time [s]"]) == 9
    least = 9.0
    with pytest.raises(Stalled):
        run_again(fault, recipe, "recipe", 1)


def test_ways_to_run_again_are_of_equal_length(fault: SettledCase) -> None:
    """And stay within what each input was in the recording."""
    recipe = recipe_for(fault)
    assert samples_of(recipe, 1.0) == [12, 9]
    for arm in ARMS:
        found = courses(fault, recipe, arm)
        for name, course in found.items():
            known = fault.scene.given[name]
            assert len(course) == 21
            assert known.min() - 1e-9 <= course.min() <= course.max() <= known.max() + 1e-9
    for name, course in courses(fault, recipe, "recipe").items():
        assert course[11] == pytest.approx(fault.scene.given[name].min(), rel=1e-3)
        assert course[20] == pytest.approx(fault.scene.given[name].max(), rel=1e-3)


def test_in_production_a_plant_may_be_run_farther_than_it_was(tmp_path: Path) -> None:
    """What was recorded is a part of what its limits allow; baselines stay within these."""
    plan = Planned("made", "production", "dosing", "production", ("fouling",), 300.0, small=True)
    case = plan.make()
    case.write(tmp_path)
    limits = yaml.safe_load((tmp_path / "limits.yaml").read_text(encoding="utf-8"))["inputs"]
    allowed, recipe = case.may_be_set, recipe_for(case)
    assert limits.keys() == allowed.keys() == set(case.scene.rig.inputs)
    assert limits["A.n"]["highest"] == pytest.approx(60.0 * allowed["A.n"][1])
    random = courses(case, recipe, "random")
    for name, (low, high) in allowed.items():
        recorded = case.scene.given[name][case.scene.first :]
        assert np.ptp(recorded) < 0.35 * (high - low)
        assert low - 0.5 <= random[name].min() <= random[name].max() <= high + 0.5


def test_what_nobody_can_set_is_refused(fault: SettledCase) -> None:
    recipe = recipe_for(fault)
    recipe["steps"][0]["inputs"]["A.T"] = {"value": 20.0, "unit": "degC"}
    with pytest.raises(ValueError, match=r"A\.T: nobody can set this"):
        courses(fault, recipe, "recipe")


def test_both_recordings_stand_on_one_axis_of_time() -> None:
    assert dated("time [s],A.n [rpm]\n0,5\n90,\n").splitlines() == [
        "time,A.n [rpm]",
        "2026-01-05 06:00:00,5",
        "2026-01-05 06:01:30,",
    ]


OPEN = sealed(LEAK, "fault")


def form_of(**sets: float) -> dict[str, Any]:
    """An answer in which sets stand, by the id of their only part (`none` for the empty one)."""
    named = [
        {"names": [] if n == "none" else [f"A.{n}!"], "probability": p} for n, p in sets.items()
    ]
    best = max(sets, key=lambda name: sets[name])
    effect = {
        **{"effect": best, "id": f"A.{best}", "module": "A", "modules": ["A"], "place": "bypass"},
        **{"sort": "fault", "probability": sets[best], "alternatives": [], "parameters": {}},
    }
    return {"verdict": "fault", "effects": [effect], "standing": named}


def recipe_of(before: dict[str, Any], until: float = 60.0, covers: bool = False) -> dict[str, Any]:
    """A recipe of one step that tells the explanations of an answer apart."""
    step = {"until": until, "covers": covers}
    trust = {"certainty": [0.55, 0.9], "factors": [[0.0, 2.0], [3.0, 0.0]]}
    return {"steps": [step], **trust, "explanations": before["standing"]}


MISSED = planted("a case", "leakage", 50.0, said="clogging", name_right=0.0)


def test_the_true_explanation_is_what_is_planted_and_no_more() -> None:
    """A nameless effect is right at its place; on a clean plant nothing is."""
    assert right_set(OPEN, ["A.leakage!"], {})
    assert right_set(OPEN, ["A.leakage/"], {})
    assert not right_set(OPEN, ["A.leakage!", "A.clogging!"], {})
    assert not right_set(OPEN, ["B.leakage!"], {})
    assert not right_set(OPEN, ["signal:A.bypass~A.n"], {})
    unnamed = replace(OPEN, verdict="unnamed", effects=(replace(LEAK, names=()),))
    assert right_set(unnamed, ["signal:A.bypass~A.n"], {})
    assert not right_set(unnamed, ["signal:B.dp~A.n"], {})
    assert right_set(replace(OPEN, verdict="none", effects=()), [], {})


ASKED, SURE = form_of(clogging=0.6, leakage=0.4), form_of(clogging=0.95)
COVERS = recipe_of(SURE, covers=True) | {"certainty": [0.95], "factors": [[0.0]]}
BOTH = {"recipe": form_of(leakage=0.9, clogging=0.1), "same": {"not_run": "no"}}


@pytest.mark.parametrize(
    ("recipe", "before", "arms", "outcome", "sure", "expected"),
    [
        (recipe_of(ASKED, 120.0), ASKED, BOTH, "run", (0.4, 0.9, 0.4), (0.55, 0.9)),
        (COVERS, SURE, {"recipe": form_of(leakage=1)}, "covered", (0.0, 1.0), ()),
        ({"error": "no input was changed"}, ASKED, {}, "refused", (0.4,), ()),
        ({"steps": []}, ASKED, {}, "alike", (0.4,), ()),
    ],
)
def test_gain_is_told_beside_what_was_expected(
    recipe: dict[str, Any],
    before: dict[str, Any],
    arms: dict[str, Any],
    outcome: str,
    sure: tuple[float, ...],
    expected: tuple[float, ...],
) -> None:
    """Certainty of the true explanation, before and after. A recipe that only covers predicts
    nothing; without one, and where an arm was not run, the first answer stays."""
    found = further_of(OPEN, MISSED, recipe, before, arms)
    assert (found.outcome, found.expected) == (outcome, expected)
    assert (found.sure_before, *found.sure.values()) == sure
    assert bool(list(gained([found]))) == (outcome == "run")
    (answer,) = after_of([MISSED], [found], "recipe")
    assert answer.name_right == float("recipe" in arms)
    assert all(found.after[arm] == MISSED for arm in arms if arm == "same")


def test_a_second_round_is_told_within_80_columns() -> None:
    """The finding first; kept as JSON."""
    cases = [
        planted("missed", "leakage", 50.0, said="filling-loss"),
        planted("named", "leakage", 50.0),
        judged("clean"),
    ]
    better, worse = cases[1], replace(cases[0], case="named")
    usual: dict[str, Any] = {"expected": (0.6, 0.92)}
    arms = [dict.fromkeys(ARMS, one) for one in (0.8, replace(better, case="missed"), 0.2, worse)]
    ran = [
        Further(case=name, outcome="run", sure_before=before, sure=sure, after=after, **usual)
        for name, before, sure, after in (("missed", 0.3, *arms[:2]), ("named", 0.5, *arms[2:]))
    ]
    further = (*ran, Further(case="clean", outcome="refused"))
    (bin_,) = gained(further)
    assert " ".join(bin_[1:]).replace("\N{NO-BREAK SPACE}", "") == "2 92% 50%"
    out = Terminal(file=io.StringIO(), width=80, color_system=None)
    tell(out, tables_of_rounds(cases, further))
    assert isinstance(out.file, io.StringIO)
    output = out.file.getvalue()
    assert "Round two: 2 of 3 cases were run again." in output
    assert max(map(len, output.splitlines())) <= 80
    run = Run(tuple(cases), further=further)
    assert len(json.loads(json.dumps(run.form()))["further"]) == 3


@pytest.mark.usefixtures("in_this_process")
def test_a_second_round_goes_on_where_it_was(tmp_path: Path) -> None:
    """What was recorded and answered is kept, what is not the sealed plant is not run, and all is
    judged from the files."""
    few, arms = Partition("development", 1, quick=True, only="fault-leak"), ("recipe",)
    run = Campaign(few, tmp_path, Workers(Engine(), lambda *text: None))
    seals = run.sealed()
    (folder,) = [folder_of(tmp_path, i) for i, seal in enumerate(seals) if seal]
    before, after = form_of(leakage=0.6, clogging=0.4), form_of(leakage=0.95, clogging=0.05)
    own = folder / ROUND / "recipe"
    own.mkdir(parents=True)
    (folder / PLAN).write_text(json.dumps(recipe_of(before)))
    (folder / FORM).write_text(json.dumps(before))
    with pytest.raises(Changed, match="not the one that was sealed"):
        asked_again(run, ["0" * 64], arms)
    (own / FORM).write_text(json.dumps(after))
    asked_again(run, seals, arms)
    assert [FORM] == [file.name for file in own.iterdir()]
    assert not (folder / ROUND / FIRST).exists()
    first = [judged(few.cases()[0].name, planted=("leak@A",))]
    (found,) = judged_again(run, seals, first, arms)
    assert (found.outcome, found.expected) == ("run", (0.55, 0.9))
    assert (found.sure_before == 0.6) == (found.sure["recipe"] == 0.95)
