"""The independent truth of stationary plants: its numbers, its cases and their key; what makes
cases harder, form errors, noise with a memory, drifts, few states; mistakes of wiring and files."""

import functools
from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main as rulec
from rulec.prove.judge import judge
from rulec.prove.truth.sensors import INSIDE, Sensing, read
from rulec.prove.truth.settled.detection_limit import visible_outputs
from rulec.prove.truth.settled.effect import EFFECTS, WIRING
from rulec.prove.truth.settled.effect_size import NEAR
from rulec.prove.truth.settled.operated_plant import Scene, scene
from rulec.prove.truth.settled.plan import Planned, SettledCase
from rulec.prove.truth.settled.rig import PUMPS
from rulec.prove.truth.settled.rigs import drawn_rig
from rulec.prove.truth.settled.suite import HARD, planned
from rulec.prove.truth.smooth import SIZE_OF_FORM, drift, form_error
from rulec.prove.truth.streams import stream
from rulec.prove.truth.units import BAR, LITRE_PER_HOUR, Array
from tests.conftest import ROOT, plain_yaml

KB = ROOT / "kb"


@pytest.mark.parametrize("kind", PUMPS)
def test_numbers_are_those_of_the_module_types(kind: str) -> None:
    """The truth reads no file of the tool; its copies agree."""
    pump = PUMPS[kind]
    stated = plain_yaml(KB / "modules" / f"{pump.type}.yaml")["parameters"]
    assert set(stated) == set(pump.numbers)
    units = {"l/h": LITRE_PER_HOUR, "bar": BAR, "rpm": 1 / 60, "l/min": 1e-3 / 60}
    units |= {"ml/rev": 1e-6, "ml/stroke": 1e-6, "W": 1.0, "1": 1.0, "W/K": 1.0}
    units["m3/h"] = 1e3 * LITRE_PER_HOUR
    for name, entry in stated.items():
        value, u = pump.numbers[name]
        if entry["unit"] in units:
            unit = units[entry["unit"]]
            assert float(entry["value"]) * unit == pytest.approx(value)
            assert float(entry["u"]) * unit == pytest.approx(u)
        # The share is free of units.
        assert float(entry["u"]) * value == pytest.approx(u * float(entry["value"]))


def test_the_key_names_entries_that_exist() -> None:
    assert len({**EFFECTS, **WIRING}) == len(EFFECTS) + len(WIRING)
    for effect in EFFECTS.values():
        assert (effect.sort == "unnamed") == (not effect.entries)
        for theirs, parameters in effect.entries.items():
            kind = "faults" if effect.sort == "fault" else "effects"
            stated = plain_yaml(KB / kind / f"{theirs}.yaml")
            if kind == "effects":
                assert set(parameters) <= set(stated["parameters"])


@functools.cache
def alone(effect: str, aim: float) -> SettledCase:
    return Planned(f"test {effect}", "single", "dosing", "steps", (effect,), aim, small=True).make()


def test_a_written_case_tells_nothing(tmp_path: Path) -> None:
    """And the tool accepts the plant."""
    alone("slip-warm", 1000.0).write(tmp_path)
    files = {str(p.relative_to(tmp_path)): p for p in tmp_path.rglob("*") if p.is_file()}
    assert {"plant/plant.yaml", "recording.csv"} == set(files)
    assert not any(b"slip" in file.read_bytes() for file in files.values())
    assert rulec(["check", str(tmp_path / "plant")]) == 0


def test_what_is_not_recorded_has_no_column(tmp_path: Path) -> None:
    plan = Planned(
        "test hidden", "unrecorded", "dosing", "steps", ("slip-warm",), 2000.0, small=True
    )
    case = plan.make()
    assert ("unnamed", "T") == (case.answer.verdict, case.answer.unrecorded)
    case.write(tmp_path)
    assert ".T " not in (tmp_path / "recording.csv").read_text(encoding="utf-8").partition("\n")[0]


@pytest.mark.parametrize("effect", ["slip-warm", "laminar", "power-warm"])
def test_what_is_visible_grows_with_the_size(effect: str) -> None:
    """As aimed; nothing is visible of nothing."""
    for aim in (30.0, 1000.0):
        case = alone(effect, aim)
        (planted,) = case.answer.effects
        assert 0.6 * aim < planted.gain < 1.7 * aim
    assert visible_outputs(case.scene).gain(()) == pytest.approx(0.0, abs=1e-9)


def test_a_drawn_plant_runs_at_all_of_its_speeds() -> None:
    for seed in range(20):
        rig = drawn_rig("dosing", stream(seed, "rig"))
        drawn = scene(rig, seed, 60, "steps")
        assert all(np.all(drawn.plain[f"{m}.Q"] > 0) for m in rig.pumps)


def test_what_a_pump_alone_has_is_planned_where_it_stands() -> None:
    """Metered pumps, warm oil sets and valves; with no effect of a dosing pump or a line."""
    for case in planned(3, {"single": 120, "pair": 40}):
        kinds = [EFFECTS[e].kinds for e in case.effects]
        for pump, family in (("metered", "bench"), ("oil-warm", "warm"), ("valve", "valve")):
            assert (case.family == family) == ((pump,) in kinds)
            if case.family == family:
                assert all(not k or pump in k for k in kinds)


@functools.cache
def hard(*difficulties: str, profile: str = "few-states") -> Scene:
    name = f"test {difficulties}"
    plan = Planned(name, "form-clean", "dosing", profile, small=True, difficulties=difficulties)
    return plan.make().scene


def test_a_form_error_has_the_size_that_was_asked_for() -> None:
    """Root mean square over its range; the mean is zero; smooth; the same in plain numbers, and
    beyond its range it stays."""
    for seed in range(10):
        form = form_error(stream(seed, "form"), 0.01, ((2.0, 5.0), (0.0, 3e5)))
        speed, pressure = np.meshgrid(np.linspace(2, 5, 80), np.linspace(0, 3e5, 80))
        values = form(speed, pressure)
        assert values.std() == pytest.approx(0.01, rel=0.05)
        assert abs(values.mean()) < 0.001
        assert np.abs(np.diff(values, axis=1)).max() < 0.02
    form, levels = form_error(stream(1, "form"), 0.01, ((0.0, 30.0),)), np.linspace(0.0, 30.0, 50)
    assert [form.at(float(v)) for v in levels] == pytest.approx(form(levels).tolist(), abs=1e-12)
    assert form.at(40.0) == form.at(30.0)


def test_laws_are_off_by_their_form_errors() -> None:
    """What a line loses differs from its formula by as much as the answer says, at each flow."""
    scene = hard("form")
    # Flow or head, power and line of each pump, and each mixer.
    assert len(scene.hard.form) == 3 * len(scene.rig.pumps) + len(scene.rig.mixers)
    assert all(SIZE_OF_FORM[0] <= form.rms <= SIZE_OF_FORM[1] for form in scene.hard.form.values())
    for mixer in scene.rig.mixers:
        flow = np.sum([scene.plain[f"{m}.Q"] for m in scene.rig.pumps], axis=0)
        law = scene.values[f"{mixer}.k0"] + scene.values[f"{mixer}.k2"] * flow**2
        off = scene.plain[f"{mixer}.dp"] / law - 1.0
        assert off == pytest.approx(scene.hard.form[f"{mixer}.loss"](flow), abs=1e-9)
        assert 0.0 < np.abs(off).max() < 4 * SIZE_OF_FORM[1]


def test_a_metered_pump_has_form_errors_of_head_and_power() -> None:
    """It stands between two valves: there is no law of a line. What is seen at best is told."""
    plan = Planned(
        "metered", "all", "bench", "few-states", ("cavitation",), 2000.0, small=True,
        difficulties=("form", "coloured", "wobble", "drift"),
    )  # fmt: skip
    made = plan.make()
    laws = {f"{m}.{law}" for m in made.scene.rig.pumps for law in ("head", "power")}
    assert laws == set(made.scene.hard.form)
    assert 0.0 < made.answer.effects[0].gain < 2000.0 * NEAR


def test_readings_have_the_memory_that_the_answer_states() -> None:
    scene = hard("coloured", profile="long-constant")
    for column, coefficient in scene.hard.colour.items():
        value = np.full(20000, float(scene.plain[column][0]))
        error = scene.read(column, value, Sensing(systematic=False))
        found = np.corrcoef(error[1:], error[:-1])[0, 1]
        assert found == pytest.approx(coefficient, abs=0.03)


def test_drift_stays_within_the_class() -> None:
    """From first to last sample, smooth, and it does drift."""
    sensor, value = PUMPS["cavity"].sensors["dp"], np.full(600, 3e5)
    quiet = Sensing(statistical=0.0, law=INSIDE.law)
    for seed in range(50):
        course = drift(stream(seed, "drift"))
        error = read(sensor, "A.dp", value, quiet, seed, drift=course) - sensor.shown(value)
        assert np.abs(error).max() <= sensor.bound * (1 + 1e-9)
        assert np.abs(np.diff(error)).max() < 0.05 * sensor.bound
        assert np.ptp(error) > 0.0


def test_a_plant_with_few_states_keeps_to_them() -> None:
    """Three to six, most samples at rest."""
    scene = hard("form")
    module = next(iter(scene.rig.pumps))
    speed = scene.given[f"{module}.n"][scene.first :]
    rest = speed[1:][np.abs(np.diff(speed)) < 1e-6 * speed[1:]]
    assert 3 <= np.unique(np.round(rest, 3)).size <= 6
    assert rest.size > 0.6 * speed.size


def test_difficulties_stand_in_the_answer_and_are_no_effects() -> None:
    """A clean case with all of them is clean; of cases without them the answer is as it was."""
    for case in planned(1, {"all-clean": 1, "clean": 1}, small=True):
        made = case.make()
        answer, wobble = made.answer, made.scene.hard.sizes.get("wobble", {})
        assert answer.verdict == "none"
        assert set(wobble) == {*(made.scene.rig.inputs if case.group == "all-clean" else ())}
        assert (case.group == "all-clean") == ("difficulties" in answer.to_json())


def test_the_suite_draws_all_groups_with_difficulties_and_every_mistake() -> None:
    mistakes = planned(3, {"wiring": 2 * len(WIRING)})
    assert {case.effects[0] for case in mistakes} == set(WIRING)
    for case in planned(2, dict.fromkeys(HARD, 2)):
        assert bool(case.difficulties) == (case.group != "wiring")
        assert bool(case.effects) != case.group.endswith("-clean")


@functools.cache
def mistaken(effect: str) -> SettledCase:
    return Planned(
        f"mistake {effect}", "wiring", "dosing", "steps", (effect,), 2000.0, small=True
    ).make()


Columns = dict[str, Array]


def columns(effect: str) -> tuple[tuple[str, ...], Columns, Columns]:
    """Places of a mistake; what is recorded by place, with the mistake and as it should be, in the
    sensors' units."""
    case = mistaken(effect)
    shown = (case.scene.recorded(case.scene.truly(t), t) for t in (case.terms, ()))
    wrong, right = ({h.partition(" [")[0]: v for h, v in c.items()} for c in shown)
    return case.answer.effects[0].places, wrong, right


@pytest.mark.parametrize(
    "effect",
    [e if i % 4 == 0 else pytest.param(e, marks=pytest.mark.prove) for i, e in enumerate(WIRING)],
)
def test_a_mistake_is_an_error_of_sensors_at_the_columns_that_are_wrong(effect: str) -> None:
    """Those columns and no others are wrong; the verdict is `sensor`."""
    places, wrong, right = columns(effect)
    off = {column for column in right if not np.array_equal(wrong[column], right[column])}
    assert off == set(places)
    assert len(off) == (2 if effect.startswith("swapped") else 1)
    assert mistaken(effect).answer.verdict == "sensor"


@pytest.mark.parametrize("effect", ["unit-dp", "unit-power", "unit-speed"])
def test_a_column_in_another_unit_is_off_by_its_factor(effect: str) -> None:
    (column,), wrong, right = columns(effect)
    ratio = float(np.median(wrong[column] / right[column]))
    assert abs(ratio - 1.0) > 0.5
    assert wrong[column] == pytest.approx(ratio * right[column])


def test_other_columns_hold_what_the_mistake_says() -> None:
    """The other's readings, the other sign, the same later."""
    (one, other), wrong, right = columns("swapped-dp")
    assert np.array_equal(wrong[one], right[other])
    assert np.array_equal(wrong[other], right[one])
    (column,), wrong, right = columns("turned-dp")
    assert np.array_equal(wrong[column], -right[column])
    (column,), wrong, right = columns("late-speed")
    late, known = wrong[column], right[column]
    assert 2 <= next(k for k in range(1, known.size) if np.array_equal(late[k:], known[:-k])) <= 60


def test_a_name_counts_with_its_id_and_either_of_two_swapped_columns() -> None:
    """As the answer's JSON tells it."""
    case = mistaken("swapped-dp")
    (planted,) = case.answer.effects
    for column, module in ((p, p.partition(".")[0]) for p in planted.places):
        found = {
            "effect": "swapped-columns", "id": f"{column}.swapped-columns", "module": module,
            "modules": [module], "place": "dp", "probability": 0.97, "alternatives": (),
            "parameters": {}, "sort": "sensor",
        }  # fmt: skip
        form = {"verdict": "sensor", "effects": (found,), "locations": ()}
        result = judge(case.answer, form)
        assert (1.0, 1.0, True) == (result.name_right, result.place_right, result.told_right)
        other = {**form, "effects": ({**found, "effect": "gain-error"},)}
        result = judge(case.answer, other)
        assert (0.0, 1.0) == (result.name_right, result.place_right)
