"""Set points that tell explanations apart: what they are worth, and what is predicted of them."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.recordings.recording import Recording, read_recording
from scipy.stats import qmc

from rulec.cli import main
from rulec.effects.model_builder import open_builder
from rulec.mismatch.experiment.choose import certain, chosen, covering, gains
from rulec.mismatch.experiment.forecast import Forecast, Places, forecast, known_with_onsets
from rulec.mismatch.experiment.points import (
    Feasible,
    InputRanges,
    input_ranges,
    places_in,
    surroundings,
)
from rulec.mismatch.experiment.recipe import experiment_page
from rulec.mismatch.search.settled.posterior_curve import solved
from rulec.mismatch.search.settled.sets import Posterior, explain
from rulec.prove.truth.settled.plan import Planned
from tests.conftest import compiled
from tests.runtime.mismatch.experiments import made_by_hand
from tests.runtime.mismatch.made import rows_at

HALVES = np.array([0.5, 0.5])


def told(off: float, spread: float) -> list[Forecast]:
    """Two explanations, each predicting one reading at each of two places: at the first alike, at
    the second so far apart, the second explanation with so large a spread."""
    place = np.array([0, 1])
    covariance = (np.eye(2), np.diag([1.0, spread]))
    shares = (0.5, 0.5)
    first = Forecast({}, place, (np.zeros(2), np.array([0.0, off])), covariance, shares=shares)
    second = Forecast({}, place, (np.array([0.0, -off]), np.zeros(2)), covariance, shares=shares)
    return [first, second]


def factors_of(forecasts: list[Forecast]) -> np.ndarray:
    """Expected log Bayes factors by the second place alone."""
    return np.array([gains(own, true, [], [1])[:, 0] for true, own in enumerate(forecasts)])


def test_factors_grow_place_by_place_to_that_of_all() -> None:
    """The chain rule, against the divergence of all rows at once; one place has a row less."""
    random = np.random.default_rng(0)
    point = np.repeat(np.arange(5), 3)[:-1]
    size = len(point)

    def covariance() -> np.ndarray:
        table = random.normal(size=(size, size))
        return np.asarray(table @ table.T + np.eye(size))

    forecasts = [
        Forecast(
            {},
            point,
            tuple(random.normal(size=(3, size))),
            tuple(covariance() for _ in range(3)),
        )
        for _ in range(3)
    ]
    choice = chosen(forecasts, np.array([0.5, 0.3, 0.2]), 4)
    assert len(choice.places) == 4
    at = np.flatnonzero(np.isin(point, choice.places))
    for true, own in enumerate(forecasts):
        for other in range(3):
            first, second = (own.covariance[i][np.ix_(at, at)] for i in (true, other))
            apart, inverse = (own.off[true] - own.off[other])[at], np.linalg.inv(second)
            grown = np.linalg.slogdet(second)[1] - np.linalg.slogdet(first)[1]
            whole = np.trace(inverse @ first) + apart @ inverse @ apart - len(at) + grown
            assert choice.factors[true, other] == pytest.approx(0.5 * whole, abs=1e-9)


def test_longer_means_have_less_noise_and_nothing_else_less() -> None:
    """Half of the variance is noise here: of means nine times as long a ninth of it is left."""
    longer = told(4.0, 1.0)[0].held(9.0)
    rows = np.arange(2)
    found = longer.between(0, rows[:, None], rows[None, :])
    assert found == pytest.approx((0.5 + 0.5 / 9.0) * np.eye(2))


@pytest.mark.parametrize(("off", "spread"), [(3.0, 1.0), (0.0, 4.0), (2.0, 2.0)])
def test_a_factor_is_the_divergence_of_two_normal_distributions(off: float, spread: float) -> None:
    """Source: Kullback and Leibler 1951, for one dimension."""
    factors = factors_of(told(off, spread))
    forward = 0.5 * (math.log(spread) + (1.0 + off**2) / spread - 1.0)
    backward = 0.5 * (-math.log(spread) + (spread + off**2) - 1.0)
    assert factors[0, 1] == pytest.approx(forward)
    assert factors[1, 0] == pytest.approx(backward)


def test_certainty_runs_from_chance_to_one() -> None:
    """Without a factor it is that of the odds; with large ones the truth stands alone."""
    assert certain(HALVES, np.zeros((2, 2))) == pytest.approx(0.5)
    assert certain(HALVES, np.full((2, 2), 50.0) * (1 - np.eye(2))) > 0.99


def test_the_place_is_chosen_where_they_differ() -> None:
    """Where they are alike a step is worth nothing, and none is taken."""
    choice = chosen(told(4.0, 1.0), HALVES, 1)
    assert choice.places == (1,)
    assert choice.certainty[1] > 0.85
    assert chosen(told(0.0, 1.0), HALVES, 3).places == ()


def test_what_can_be_expected_counts_how_readings_scatter() -> None:
    """One reading three deviations apart; by one dimension's integral."""
    read, apart = np.linspace(-8.0, 8.0, 801), 3.0
    sure = 1.0 / (1.0 + np.exp(-0.5 * apart**2 - apart * read))
    mean = float(np.average(sure, weights=np.exp(-0.5 * read**2)))
    found = chosen(told(apart, 1.0), HALVES, 1).certainty
    assert found == pytest.approx((0.5, mean), abs=0.01)


def test_what_is_not_listed_is_never_sure() -> None:
    """However far the others are apart, it keeps its part against the true one, and is no gain
    where it is true itself."""
    found = chosen(told(60.0, 1.0), 0.5 * HALVES, 1).certainty
    assert found == pytest.approx((2 * 0.25**2, 2 * 0.25 * (0.25 / 0.75)))
    assert chosen(told(60.0, 1.0), 0.1 * HALVES, 1).places == (1,)


@pytest.fixture(scope="module")
def ambiguous(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive that takes back its speed at high power, which three laws of the catalogue do."""
    folder = tmp_path_factory.mktemp("ambiguous")
    case = Planned("a case", "single", "dosing", "steps", ("folded-back",), aim=1000.0, small=True)
    case.make().write(folder)
    plant, recording = str(folder / "plant"), str(folder / "recording.csv")
    assert main(["mismatch", plant, recording, "--json", str(folder / "m.json")]) == 0
    return folder


@pytest.fixture(scope="module")
def planned(ambiguous: Path) -> Path:
    """The machine form of the recipe, with inputs and a page beside it."""
    form, file = ambiguous / "e.json", str(ambiguous / "m.json")
    files = ["-o", str(ambiguous / "in.csv"), "--report", str(ambiguous / "e.html")]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(["experiment", file, "--json", str(form), *files]) == 0
    assert "the expected probability of the true" in out.getvalue()
    return form


def test_a_recipe_can_be_run(ambiguous: Path, planned: Path) -> None:
    """Set points lie within what was recorded; `rulec simulate` takes the inputs; certainty grows
    from step to step; and each explanation finds what it predicts itself."""
    inputs, form, page = ambiguous / "in.csv", planned, ambiguous / "e.html"
    found: dict[str, Any] = json.loads(form.read_text(encoding="utf-8"))
    assert len(found["explanations"]) >= 2
    assert found["steps"]
    assert found["certainty"] == sorted(found["certainty"])
    assert found["unlisted"] == pytest.approx(
        1.0 - sum(one["probability"] for one in found["explanations"])
    )
    assert found["certainty"][-1] > found["certainty"][0] + 0.1
    recorded = columns(ambiguous / "recording.csv")
    for step in found["steps"]:
        for name, value in step["inputs"].items():
            readings = recorded[name]
            assert readings.min() * 0.999 <= value["value"] <= readings.max() * 1.001
    simulated = ambiguous / "out.csv"
    assert main(["simulate", str(ambiguous / "plant"), str(inputs), "-o", str(simulated)]) == 0
    assert (
        len(simulated.read_text(encoding="utf-8").splitlines()) == 1 + found["steps"][-1]["until"]
    )
    assert found["sensors"] == []
    assert "<svg" in page.read_text(encoding="utf-8")


def test_limits_are_kept_and_told(
    ambiguous: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Readings stay below theirs whatever is true, the way there takes its time, and product that
    is lost is told."""
    limits, form = tmp_path / "limits.yaml", tmp_path / "e.json"
    limits.write_text(
        "limits: concealed\n"
        "inputs:\n"
        "  A.n: {lowest: 600, highest: 1200, unit: rpm, rate: 10, costs: product}\n"
        "readings:\n"
        "  A.dp: {highest: 1.6, unit: bar}\n",
        encoding="utf-8",
    )
    file = str(ambiguous / "m.json")
    more = ["--limits", str(limits), "--steps", "3", "--json", str(form)]
    assert main(["experiment", file, *more]) == 0
    told = " ".join(capsys.readouterr().out.split())
    found: dict[str, Any] = json.loads(form.read_text(encoding="utf-8"))
    step = found["steps"][0]
    before = columns(ambiguous / "recording.csv")["B.n"][-1]
    assert 600 <= step["inputs"]["A.n"]["value"] <= 1200
    assert step["inputs"]["B.n"]["value"] == pytest.approx(before)
    assert step["costs_product"] == ["A.n"]
    times = (step["until"] - step["from"] - step["ramp"]) / 60.0
    assert times == pytest.approx(2.0 ** round(math.log2(times)))
    read = next(r for r in step["readings"] if r["signal"] == "A.dp")
    assert all(v + u < 1.6 for v, u in zip(read["values"], read["u"], strict=True))
    assert found["limits"]["given"]
    assert "Product is lost in steps 1 to 3 (by A.n)." in told
    assert not any(step["covers"] for step in found["steps"])
    assert "within the limits: A.n 600 to 1 200 rpm." in told


def columns(file: Path) -> dict[str, np.ndarray]:
    """Readings by signal."""
    with file.open(encoding="utf-8", newline="") as lines:
        head, *rows = csv.reader(lines)
    table = np.array([[float(cell or "nan") for cell in row] for row in rows])
    return {title.partition(" [")[0]: table[:, i] for i, title in enumerate(head)}


def test_fewer_steps_are_the_first_ones(ambiguous: Path, planned: Path, tmp_path: Path) -> None:
    """Each step is the best one beside those before it."""
    first = tmp_path / "first.json"
    assert (
        main(["experiment", str(ambiguous / "m.json"), "--steps", "1", "--json", str(first)]) == 0
    )
    steps = [json.loads(form.read_text(encoding="utf-8"))["steps"] for form in (planned, first)]
    assert len(steps[0]) > len(steps[1]) == 1
    assert steps[0][0]["inputs"] == steps[1][0]["inputs"]


@pytest.mark.parametrize(
    ("flag", "value", "words"),
    [
        ("--hours", "nan", "one step takes"),
        ("--steps", "0", "has one step at least"),
    ],
)
def test_no_time_for_a_step_is_said(
    ambiguous: Path, capsys: pytest.CaptureFixture[str], flag: str, value: str, words: str
) -> None:
    """It must not look as if no set points helped."""
    assert main(["experiment", str(ambiguous / "m.json"), flag, value]) == 1
    assert words in " ".join(capsys.readouterr().err.split())


Worn = tuple[Recording, Posterior]


@pytest.fixture(scope="module")
def worn(tmp_path_factory: pytest.TempPathFactory) -> Worn:
    """A pump that wears while it is recorded, and all sets of explanations of that."""
    folder = tmp_path_factory.mktemp("worn")
    case = Planned("a case", "single", "dosing", "steps", ("wear",), aim=3000.0, small=True)
    case.make().write(folder)
    opened = open_builder(folder / "plant")
    recording = read_recording(folder / "recording.csv", opened[0])
    return recording, explain(rows_at(opened, recording), lambda text: None)


def soon_and_late(worn: Worn) -> tuple[Places, Places]:
    """The same operating points next, and ten times as long as the recording later."""
    recording, found = worn
    system = found.geometry.rows.system
    soon = places_in(system, input_ranges(system, recording, 1.0))
    return soon, replace(soon, time=soon.time + 10.0 * float(np.ptp(system.data.time)))


def test_a_sensor_that_shows_nothing_hinders_no_plan(worn: Worn) -> None:
    """Where one reading is missing throughout, points are as near to recorded ones as with it."""
    recording, found = worn
    system = found.geometry.rows.system
    data, gone = system.data, found.geometry.rows.cells[0].outputs[0]
    values = {**data.points.values, gone: np.full(len(data), np.nan)}
    without = replace(system, data=replace(data, points=replace(data.points, values=values)))
    reach = input_ranges(system, recording, 1.0)
    there, all_ = places_in(without, reach), places_in(system, reach)
    assert (there.near == all_.near).mean() > 0.9


def test_what_follows_time_is_foretold_for_later(worn: Worn) -> None:
    """A drift goes on while the experiment runs."""
    found = worn[1]
    names = next(n for n in found.models if any(".wear-slip@" in name for name in n))
    models = [found.models[names], found.models[frozenset()]]
    apart = []
    for places in soon_and_late(worn):
        there = forecast(found.geometry, models, 0, places)
        assert np.abs(there.off[0]).max() < 1e-6
        apart.append(float(np.abs(there.off[1]).max()))
    assert apart[1] > 2.0 * apart[0]


def test_when_a_fault_began_to_grow_is_doubted(worn: Worn) -> None:
    """One more number makes nothing surer, and it is known to less than the recording is long. What
    grows has grown further in a later reading, and is predicted the less surely."""
    found = worn[1]
    geometry = found.geometry
    growing = {n: m for n, m in found.models.items() if any(c.grows for c in m.setting.courses)}
    model = growing[max(growing, key=lambda names: found.odds[names])]
    held, open_ = np.diag(solved(model)[1]), np.diag(known_with_onsets(geometry, model))
    assert (open_[: len(held)] >= held * (1.0 - 1e-6)).all()
    u_onsets = np.sqrt(open_[len(held) :])
    length = float(np.ptp(geometry.rows.system.data.time))
    assert ((u_onsets > 0.0) & (u_onsets <= length)).all()
    plain = found.models[frozenset()]
    soon, late = (forecast(geometry, [model, plain], 0, places) for places in soon_and_late(worn))
    assert np.abs(late.off[1]).max() > 2.0 * np.abs(soon.off[1]).max()
    assert max(late.covariance[0].diagonal()) > max(soon.covariance[0].diagonal())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda form: form.pop("standing"), "does not say which explanations stand"),
        (lambda form: form.update(standing=[]), "no sets of explanations were weighed"),
        (lambda form: form["standing"][0].update(probability="much"), "does not say which"),
        (lambda form: form["standing"][0].update(joined=["A.no-such@n"]), "A.no-such@n"),
    ],
)
def test_what_cannot_be_planned_is_refused(
    ambiguous: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: Any, words: str
) -> None:
    form = json.loads((ambiguous / "m.json").read_text(encoding="utf-8"))
    change(form)
    file = tmp_path / "m.json"
    file.write_text(json.dumps(form), encoding="utf-8")
    assert main(["experiment", str(file)]) == 1
    assert words in " ".join(capsys.readouterr().err.split())


def test_an_explanation_that_stands_alone_is_tested(
    ambiguous: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Steps cover what may be set: each input comes near both ends of what was recorded."""
    form = json.loads((ambiguous / "m.json").read_text(encoding="utf-8"))
    form.update(standing=form["standing"][:1])
    alone, plan = tmp_path / "m.json", tmp_path / "e.json"
    alone.write_text(json.dumps(form), encoding="utf-8")
    words = ["--json", str(plan), "--report", str(tmp_path / "e.html")]
    assert main(["experiment", str(alone), *words]) == 0
    assert "One explanation is left. 18 steps in" in capsys.readouterr().out
    found = json.loads(plan.read_text(encoding="utf-8"))
    assert all(step["covers"] for step in found["steps"])
    assert len(found["certainty"]) == 1
    recorded = columns(ambiguous / "recording.csv")
    for name in found["steps"][0]["inputs"]:
        set_to = [step["inputs"][name]["value"] for step in found["steps"]]
        low, high = np.quantile(recorded[name], [0.25, 0.75])
        assert min(set_to) < low < high < max(set_to)


def test_steps_that_cover_are_far_from_all_others() -> None:
    """On a line with steps at both ends the middle comes next, then the quarters; there is time for
    one more, and none is where it may not be."""
    speeds = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 0.0])
    places = Places({"A.n": speeds}, np.zeros(6, dtype=np.intp), np.zeros(6))
    may = np.array([True] * 5 + [False])
    limited = Feasible(places, InputRanges({"A.n": (0.0, 4.0)}, 60.0), may, {}, ((),) * 6, ())
    assert covering(limited, may, [0, 4], 9, 240.0) == (2, 1, 3)
    assert covering(limited, may, [0, 4], 9, 100.0) == (2,)
    assert covering(limited, may, [], 2, 240.0) == (2, 0)
    assert covering(limited, may & (speeds != 2.0), [0, 4], 1, 240.0) == (1,)


def test_steps_that_cover_give_each_input_many_values() -> None:
    """Of four inputs too, where points farthest from each other are corners: no gap along any is
    as large as one between values drawn at random can be expected to be."""
    shares = qmc.Sobol(4, scramble=False).random_base2(7)
    shares = np.concatenate([np.array(list(product((0.0, 1.0), repeat=4))), shares])
    names, count = ("A.n", "B.n", "C.n", "D.n"), len(shares)
    places = Places(dict(zip(names, shares.T, strict=True)), np.zeros(count, int), np.zeros(count))
    reach = InputRanges(dict.fromkeys(names, (0.0, 1.0)), 60.0)
    may = np.ones(count, dtype=bool)
    limited = Feasible(places, reach, may, {}, ((),) * count, ())
    steps = list(covering(limited, may, [], 18, 3600.0))
    for values in np.sort(shares[steps].T):
        assert values[0] < 0.1 < 0.9 < values[-1]
        assert np.diff(values).max() < (1.0 / np.arange(1, 20)).sum() / 19


def test_what_nobody_sets_stays_or_follows_the_load() -> None:
    """A temperature that did not follow the set point is as it was last; one that did follows."""
    random = np.random.default_rng(1)
    speed, time = random.uniform(5.0, 15.0, 400), np.arange(400.0)
    recorded = {"n": speed, "warm": 20.0 + 2.0 * speed, "day": 20.0 + time / 40.0}
    there = surroundings(recorded, time, ["warm", "day"], {"n": np.array([6.0, 14.0])})
    assert there["warm"] == pytest.approx([32.0, 48.0])
    assert there["day"] == pytest.approx([30.0, 30.0], abs=1.0)


def test_a_page_where_a_reading_is_foretold_in_some_steps_only() -> None:
    """Its picture has those steps; a way that takes no time has no column."""
    page = experiment_page(made_by_hand(), compiled("abc"))
    pictures = page.split("<figure")[1:]
    assert [picture.count('href="#up"') for picture in pictures] == [1, 2]
    assert '<th class="num">way</th>' not in page
