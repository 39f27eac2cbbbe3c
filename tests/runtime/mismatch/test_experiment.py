"""Set points that tell explanations apart: what is predicted of them, and within which limits."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from rulec.effects.model_builder import open_builder
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.experiment.forecast import Forecast, SetPoints, forecast
from rulec.mismatch.experiment.plan import best_choice, chosen, covering
from rulec.mismatch.experiment.points import (
    Feasible,
    InputRanges,
    feasible,
    input_ranges,
    points_in,
    surroundings,
)
from rulec.mismatch.search.operating_states import explain
from rulec.prove.truth.settled.plan import Planned
from rulec.separation.allowed import Allowed, Range
from tests.conftest import Capsys, compiled
from tests.runtime.mismatch.made import loaded, recorded, rows_at, tour
from tests.written import read_columns

HALVES = np.array([0.5, 0.5])


def told(off: float, spread: float) -> list[Forecast]:
    """Two explanations, each predicting one reading at each of two places: at the first alike, at
    the second so far apart, the second explanation with so large a spread."""
    covariance = (np.eye(2), np.diag([1.0, spread]))
    return apart(np.array([0.0, off]), covariance, (0.5, 0.5))


def apart(
    off: Array, covariance: tuple[Array, Array], shares: tuple[float, float]
) -> list[Forecast]:
    """Two explanations that predict one reading at each of some places, so far apart."""
    index, none = np.arange(len(off)), np.zeros(len(off))
    offs = ((none, off), (-off, none))
    return [Forecast({}, index, own, covariance, shares=shares) for own in offs]


def test_factors_are_divergences_of_all_rows() -> None:
    """Of all chosen places together; one place has a row less."""
    random = np.random.default_rng(0)
    point = np.repeat(np.arange(5), 3)[:-1]
    size = len(point)

    def covariance() -> np.ndarray:
        table = random.normal(size=(size, size))
        return np.asarray(table @ table.T + np.eye(size))

    def forecast() -> Forecast:
        off = tuple(random.normal(size=(3, size)))
        return Forecast({}, point, off, tuple(covariance() for _ in range(3)))

    forecasts = [forecast() for _ in range(3)]
    choice = chosen(forecasts, np.array([0.5, 0.3, 0.2]), 4)
    assert len(choice.numbers) == 4
    at = np.flatnonzero(np.isin(point, choice.numbers))
    for true, own in enumerate(forecasts):
        for other in range(3):
            first, second = (own.covariance[i][np.ix_(at, at)] for i in (true, other))
            apart, inverse = (own.off[true] - own.off[other])[at], np.linalg.inv(second)
            grown = np.linalg.slogdet(second)[1] - np.linalg.slogdet(first)[1]
            whole = np.trace(inverse @ first) + apart @ inverse @ apart - len(at) + grown
            assert choice.factors[true, other] == pytest.approx(0.5 * whole, abs=1e-9)


def test_longer_means_have_less_noise_and_nothing_else_less() -> None:
    """Half of the variance is noise here: of means nine times as long a ninth of it is left."""
    rows = np.arange(2)
    found = told(4.0, 1.0)[0].held(9.0).between(0, rows[:, None], rows[None, :])
    assert found == pytest.approx((0.5 + 0.5 / 9.0) * np.eye(2))


def test_the_place_is_chosen_where_they_differ() -> None:
    """What can be expected counts how readings scatter: by one dimension's integral."""
    assert chosen(told(0.0, 1.0), HALVES, 3).numbers == ()
    read, apart = np.linspace(-8.0, 8.0, 801), 3.0
    sure = 1.0 / (1.0 + np.exp(-0.5 * apart**2 - apart * read))
    mean = float(np.average(sure, weights=np.exp(-0.5 * read**2)))
    found = chosen(told(apart, 1.0), HALVES, 1)
    assert found.numbers == (1,)
    assert found.certainty == pytest.approx((0.5, mean), abs=0.01)


def test_what_is_not_listed_is_never_sure() -> None:
    found = chosen(told(60.0, 1.0), 0.5 * HALVES, 1).certainty
    assert found == pytest.approx((2 * 0.25**2, 2 * 0.25 * (0.25 / 0.75)))
    assert chosen(told(60.0, 1.0), 0.1 * HALVES, 1).numbers == (1,)


@pytest.fixture(scope="module")
def ambiguous(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive that takes back its speed at high power, which three laws of the catalogue do."""
    folder = tmp_path_factory.mktemp("ambiguous")
    case = Planned("a case", "single", "dosing", "steps", ("folded-back",), aim=1000.0, small=True)
    case.make().write(folder)
    plant, recording = str(folder / "plant"), str(folder / "recording.csv")
    assert main(["mismatch", plant, recording, "--json", str(folder / "m.json")]) == 0
    return folder


Form = dict[str, Any]


def read(file: Path) -> Any:
    return json.loads(file.read_text(encoding="utf-8"))


def experiment(folder: Path, *more: str) -> Any:
    form = folder / "e.json"
    assert main(["experiment", str(folder / "m.json"), "--json", str(form), *more]) == 0
    return read(form)


def columns(file: Path) -> dict[str, np.ndarray]:
    return {title.partition(" [")[0]: c for title, c in read_columns(file).items()}


def test_a_recipe_can_be_run(ambiguous: Path, capsys: Capsys) -> None:
    inputs, page, simulated = (ambiguous / name for name in ("in.csv", "e.html", "out.csv"))
    found = experiment(ambiguous, "-o", str(inputs), "--report", str(page))
    assert "the expected probability of the true" in capsys.readouterr().out
    assert len(found["explanations"]) >= 2
    assert found["certainty"] == sorted(found["certainty"])
    assert found["certainty"][-1] > found["certainty"][0] + 0.1
    listed = sum(one["probability"] for one in found["explanations"])
    assert found["unlisted"] == pytest.approx(1.0 - listed)
    recorded = columns(ambiguous / "recording.csv")
    for step in found["steps"]:
        for name, value in step["inputs"].items():
            low, high = recorded[name].min(), recorded[name].max()
            assert low * 0.999 <= value["value"] <= high * 1.001
    assert main(["simulate", str(ambiguous / "plant"), str(inputs), "-o", str(simulated)]) == 0
    lines = simulated.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + found["steps"][-1]["until"]
    assert found["sensors"] == []
    assert "<svg" in page.read_text(encoding="utf-8")
    (first,) = experiment(ambiguous, "--steps", "1")["steps"]
    assert len(found["steps"]) > 1
    assert found["steps"][0]["inputs"] == first["inputs"]


def test_limits_are_kept_and_told(ambiguous: Path, tmp_path: Path, capsys: Capsys) -> None:
    limits = tmp_path / "limits.yaml"
    limits.write_text(
        "limits: concealed\n"
        "inputs:\n"
        "  A.n: {lowest: 600, highest: 1200, unit: rpm, rate: 10, hold: 100, costs: product}\n"
        "readings:\n"
        "  A.dp: {lowest: 1.0, highest: 1.6, unit: bar}\n",
        encoding="utf-8",
    )
    found = experiment(ambiguous, "--limits", str(limits), "--steps", "3")
    output = " ".join(capsys.readouterr().out.split())
    before = {name: values[-1] for name, values in columns(ambiguous / "recording.csv").items()}
    value = found["steps"][0]["inputs"]["B.n"]["value"]
    assert value == pytest.approx(before["B.n"])
    for step in found["steps"]:
        speed = step["inputs"]["A.n"]["value"]
        assert 600 <= speed <= 1200
        assert step["ramp"] == pytest.approx(abs(speed - before["A.n"]) / 10, abs=0.01)
        before["A.n"] = speed
        assert step["inputs"]["B.n"]["value"] == value
        assert step["costs_product"] == ["A.n"]
        times = (step["until"] - step["from"] - step["ramp"]) / 100.0
        assert times == pytest.approx(2.0 ** round(math.log2(times)))
        dp = next(r for r in step["readings"] if r["signal"] == "A.dp")
        assert all(1.0 < v - u < v + u < 1.6 for v, u in zip(dp["values"], dp["u"], strict=True))
    assert found["limits"]["given"]
    assert "Product is lost in steps 1 to 3 (by A.n)." in output
    assert not any(step["covers"] for step in found["steps"])
    assert "within the limits: A.n 600 to 1 200 rpm." in output


@pytest.mark.parametrize(
    ("change", "more", "words"),
    [
        (lambda form: form.pop("standing"), (), "does not say which explanations remain possible"),
        (lambda form: form.update(standing=[]), (), "no sets of explanations were weighed"),
        (lambda form: form["standing"][0].update(probability="much"), (), "does not say which"),
        (lambda form: form["standing"][0].update(joined=["A.no-such@n"]), (), "A.no-such@n"),
        # It must not look as if no set points helped.
        (lambda form: None, ("--steps", "0"), "has one step at least"),
        pytest.param(
            lambda form: None, ("--hours", "nan"), "one step takes", marks=pytest.mark.prove
        ),
    ],
)
def test_what_cannot_be_planned_is_refused(
    ambiguous: Path,
    tmp_path: Path,
    capsys: Capsys,
    change: Callable[[Form], object],
    more: tuple[str, ...],
    words: str,
) -> None:
    form, file = read(ambiguous / "m.json"), tmp_path / "m.json"
    change(form)
    file.write_text(json.dumps(form), encoding="utf-8")
    assert main(["experiment", str(file), *more]) == 1
    assert words in " ".join(capsys.readouterr().err.split())


def test_an_explanation_that_stands_alone_is_tested(
    ambiguous: Path, tmp_path: Path, capsys: Capsys
) -> None:
    form = read(ambiguous / "m.json")
    alone = json.dumps({**form, "standing": form["standing"][:1]})
    (tmp_path / "m.json").write_text(alone, encoding="utf-8")
    found = experiment(tmp_path, "--report", str(tmp_path / "e.html"))
    assert "One explanation is left. 18 steps in" in capsys.readouterr().out
    assert all(step["covers"] for step in found["steps"])
    assert len(found["certainty"]) == 1
    recorded = columns(ambiguous / "recording.csv")
    for name in found["steps"][0]["inputs"]:
        set_to = [step["inputs"][name]["value"] for step in found["steps"]]
        low, high = np.quantile(recorded[name], [0.25, 0.75])
        assert min(set_to) < low < high < max(set_to)


def test_what_follows_time_is_foretold_for_later(tmp_path: Path) -> None:
    """What grows, as the wear of a pump, has grown further in a later reading, and is predicted
    less surely: the same operating points next, and ten times as long as the recording later."""
    case = Planned("a case", "single", "dosing", "steps", ("wear",), aim=3000.0, small=True)
    case.make().write(tmp_path)
    loaded = open_builder(tmp_path / "plant")
    recording = read_recording(tmp_path / "recording.csv", loaded[0])
    found = explain(rows_at(loaded, recording), lambda text: None)
    evidence, plain = found.evidence, found.models[frozenset()]
    system = evidence.rows.system
    places = [points_in(system, input_ranges(system, recording, 1.0))]
    places += [replace(p, time=p.time + 10.0 * float(np.ptp(system.data.time))) for p in places]
    drift = next(n for n in found.models if any(".wear-slip@" in name for name in n))
    soon, late = (forecast(evidence, [found.models[drift], plain], 0, at) for at in places)
    assert max(np.abs(there.off[0]).max() for there in (soon, late)) < 1e-6
    assert np.abs(late.off[1]).max() > 2.0 * np.abs(soon.off[1]).max()
    growing = {n: m for n, m in found.models.items() if any(c.grows for c in m.setting.courses)}
    model = growing[max(growing, key=lambda names: found.odds[names])]
    soon, late = (forecast(evidence, [model, plain], 0, at) for at in places)
    assert np.abs(late.off[1]).max() > 2.0 * np.abs(soon.off[1]).max()
    assert max(late.covariance[0].diagonal()) > max(soon.covariance[0].diagonal())


def test_steps_that_cover_are_far_from_all_others() -> None:
    """On a line with steps at both ends the middle comes next, then the quarters."""
    speeds = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 0.0])
    places = SetPoints({"A.n": speeds}, np.zeros(6, dtype=np.intp), np.zeros(6))
    may = np.array([True] * 5 + [False])
    limited = Feasible(places, InputRanges({"A.n": (0.0, 4.0)}, 60.0), may, {}, ((),) * 6, ())
    assert covering(limited, may, [0, 4], 9, 240.0) == (2, 1, 3)
    assert covering(limited, may, [0, 4], 9, 100.0) == (2,)
    assert covering(limited, may, [], 2, 240.0) == (2, 0)
    assert covering(limited, may & (speeds != 2.0), [0, 4], 1, 240.0) == (1,)


def test_what_nobody_sets_stays_or_follows_the_load() -> None:
    """A temperature that did not follow the set point is as it was last; one that did follows."""
    random = np.random.default_rng(1)
    speed, time = random.uniform(5.0, 15.0, 400), np.arange(400.0)
    recorded = {"n": speed, "warm": 20.0 + 2.0 * speed, "day": 20.0 + time / 40.0}
    early, late = np.where(time < 200.0, 1.0, np.nan), np.where(time < 200.0, np.nan, 1.0)
    # No row has all readings in the second case.
    for shown in (recorded, {**recorded, "warm": recorded["warm"] * early, "other": late}):
        names = [name for name in shown if name != "n"]
        there = surroundings(shown, time, names, {"n": np.array([6.0, 14.0])})
        assert there["warm"] == pytest.approx([32.0, 48.0])
        assert there["day"] == pytest.approx([30.0, 30.0], abs=1.0)


def test_places_keep_the_limits_of_readings_with_their_doubt() -> None:
    """On both sides, by each explanation; not where one predicts nothing, nor the present one."""
    plant, n = compiled("abc"), 6
    speed = np.array([10.0, 11.0, 12.0, 13.0, 14.0, 12.0])
    ends = {"signal": plant.signal_by_id["A.n"], "lowest": 600.0, "highest": 900.0}
    own = Range(**ends, rate=30.0, hold=100.0, costs=True)
    given = Allowed({"A.n": own}, frozenset(), {"A.dp": (1.2e5, 1.8e5)})
    ranges = InputRanges({"A.n": (10.0, 15.0)}, 60.0, {"A.n": 12.0}, given)
    one, none = np.eye(n - 1), np.zeros(n - 1)
    shown = ([1.25e5, 1.5e5, 1.5e5, 1.75e5, 1.5e5, 1.5e5], [1.5e5] * n)
    limits = [
        Forecast(
            {"A.dp": np.array(values)},
            np.delete(np.arange(n), 1),
            (none, none),
            (one, one),
            spread={"A.dp": np.full(n, 0.05e5)},
        )
        for values in shown
    ]
    places = SetPoints({"A.n": speed}, np.zeros(n, dtype=np.intp), np.zeros(n))
    for predicted in (limits, limits[::-1]):
        found = feasible(plant, places, ranges, predicted)
        assert [False, False, True, False, True, False] == found.may_run.tolist()
        assert [("A.n",)] * 2 + [()] + [("A.n",)] * 2 + [()] == list(found.costs)
        assert [(4.0, 100.0), (8.0, 100.0)] == found.times([4, 0])


def _two_places(lost: tuple[str, ...], forbids: bool) -> Feasible:
    """Of which the second may lose product or be forbidden, and the present one."""
    places = SetPoints({"A.n": np.array([1.0, 2.0, 0.0])}, np.zeros(3, dtype=np.intp), np.zeros(3))
    possible, forbidden = np.array([True, True, False]), np.array([False, forbids, False])
    ranges = InputRanges({"A.n": (1.0, 2.0)}, 60.0)
    return Feasible(places, ranges, possible, {"A.dp": forbidden}, ((), lost, ()), ())


def _sure(*off: float) -> list[Forecast]:
    return apart(np.array(off), (np.eye(2), np.eye(2)), (0.0, 0.0))


def test_the_best_step_within_limits() -> None:
    """Product is lost only where that tells clearly more."""
    for off, lost, forbids, taken in (
        ((1.0, 3.0), (), True, (0,)),
        ((1.0, 3.0), (), False, (1,)),
        ((4.0, 4.01), ("A.n",), False, (0,)),
        ((1.0, 4.0), ("A.n",), False, (1,)),
    ):
        found = _two_places(lost, forbids)
        best = best_choice(_sure(*off), HALVES, 1, 3600.0, found, 0.0)
        assert best.choice.numbers == taken
        assert best.hindering == (("A.dp",) if forbids else ())
        assert not best.time_is_short


@pytest.mark.parametrize(("seconds", "steps"), [(90.0, 1), (120.0, 2), (math.inf, 2)])
def test_no_time_for_more_is_told(seconds: float, steps: int) -> None:
    best = best_choice(_sure(2.0, 2.0), HALVES, 2, seconds, _two_places((), False), 0.0)
    assert (len(best.choice.numbers), best.time_is_short) == (steps, steps < 2)


def test_a_place_far_away_does_not_shorten_the_steps() -> None:
    """The way to the first place takes longer than all of the time; the second is near."""
    slow = Range(signal=compiled("abc").signal_by_id["A.n"], lowest=0, highest=900, rate=0.1)
    near = SetPoints({"A.n": np.array([10.0, 0.1, 0.0])}, np.zeros(3, dtype=np.intp), np.zeros(3))
    reach = InputRanges({"A.n": (0.0, 10.0)}, 60.0, allowed=Allowed({"A.n": slow}))
    limited = replace(_two_places((), False), points=near, ranges=reach)
    predicted = apart(np.array([3.0, 1.0]), (np.eye(2), np.eye(2)), (1.0, 1.0))
    best = best_choice(predicted, HALVES, 1, 3600.0, limited, 0.0)
    assert best.choice.numbers == (1,)
    assert best.limited.held > 1


def test_set_points_lie_where_pumps_run_whatever_sensors_are_not_recorded() -> None:
    """One that shows nothing, and two of which one shows nothing while the other does."""
    plant = loaded("abc")
    recording = recorded(plant, tour(plant[0], 240))
    system = rows_at(plant, recording).system
    number, read = np.arange(len(system.data)), system.data.values
    least = system.ruleset.signal_by_id["A.n"].minimum

    def shown(**values: Array) -> System:
        told = {**read, **{name.replace("_", "."): v for name, v in values.items()}}
        points = replace(system.data.points, values=told)
        return replace(system, data=replace(system.data, points=points))

    reach = input_ranges(system, recording, 1.0)
    stands = shown(A_n=np.where(number % 9 == 0, 0.0, read["A.n"]))
    assert least <= input_ranges(stands, recording, 1.0).bounds["A.n"][0] <= read["A.n"].max()
    silent = points_in(shown(C_dp=np.full(len(number), np.nan)), reach).near
    assert (silent == points_in(system, reach).near).mean() > 0.9
    lost = {
        f"{m}_dp": np.where(number % 2 == i, np.nan, read[f"{m}.dp"]) for i, m in enumerate("AB")
    }
    near = points_in(shown(**lost), reach).near
    assert np.isfinite(read["A.n"][near]).all()
