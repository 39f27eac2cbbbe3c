"""Cases of the truth of tanks: effects act, columns fit the plant, nothing is told beforehand; the
limit of what can be seen."""

import csv
import functools
import hashlib
import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main as rulec
from rulec.effects.model_builder import open_builder
from rulec.prove.truth.detection_limit import expected_gain
from rulec.prove.truth.kinds import STATED
from rulec.prove.truth.sealed import HIDES
from rulec.prove.truth.tanks.build import build
from rulec.prove.truth.tanks.effect import EFFECTS, possible_effects, right
from rulec.prove.truth.tanks.effect_size import ACCEPTED, Readings, change_of, rms, run
from rulec.prove.truth.tanks.plan import Case
from rulec.prove.truth.tanks.plant import CASCADED, Layout
from rulec.prove.truth.tanks.rows import row, write_plant
from rulec.prove.truth.tanks.sensing import shown
from rulec.prove.truth.tanks.suite import HARD, RARELY, STRONGEST, WEAKEST, cases
from tests.conftest import ROOT, plain_yaml
from tests.tank_row import ROW, UNITS, case, parameters

NOISE = 0.03
"""V; a larger change is seen."""


@functools.cache
def made(*effects: str, seed: int = 3, strength: float | None = None) -> Case:
    return case(seed, *effects, strength=strength)


def changed(of: Case) -> Readings:
    """What all effects of a case change together, V, by tank."""
    plain = shown(of.setup.plant, of.setup.course)
    return change_of(shown(of.plant, run(of.setup, of.plant)), plain)


@pytest.mark.parametrize("effect", possible_effects(CASCADED))
def test_each_effect_acts(effect: str) -> None:
    """Of the size that was sought, alone, on some reading; and never without a cause."""
    acting = made(effect)
    (one,) = acting.planted
    assert one.placed.id == effect
    least, most = ACCEPTED
    assert least <= rms(one.change["lower"]) <= most
    assert one.change["lower"] == pytest.approx(changed(acting)["lower"], abs=1e-6)
    assert np.mean(np.abs(one.change["lower"]) > NOISE) > 0.02
    y, u = (acting.readings[name] for name in ("y [V]", "u [V]"))
    assert -0.4 < y.min() < y.max() < 10.0
    assert 0.0 <= u.min() < u.max() <= 10.0


@pytest.mark.parametrize("effect", ["middle.overflow-sharp", "inflow.lag", "first.y.jet"])
def test_effects_act_in_the_row(effect: str) -> None:
    """Of an unmeasured tank, of the feed, of one of two sensors."""
    change = changed(case(3, effect, layout=ROW))
    off = {tank: round(rms(values), 4) for tank, values in change.items()}
    assert ACCEPTED[0] <= max(off.values()) <= ACCEPTED[1]
    assert (off["first"] == 0.0) == (effect == "middle.overflow-sharp")
    assert (off["last"] == 0.0) == (effect == "first.y.jet")


@pytest.mark.parametrize("effect", ["upper.leak", "lower.clogging"])
def test_faults_begin(effect: str) -> None:
    """Before that a fault changes nothing, afterwards it does."""
    faulty = made(effect)
    upper, lower = faulty.plant.tanks.values()
    begin = min(upper["leak_begin"], lower["clog_begin"])
    plain = made(seed=faulty.drawn)
    before = faulty.readings["time [s]"] < begin
    assert 0.2 < before.mean() < 0.8
    for tank in (0, 1):
        healthy, found = (run(c.setup, c.plant).levels[:, tank] for c in (plain, faulty))
        assert found[before] == pytest.approx(healthy[before], abs=1e-4)
    assert found != pytest.approx(healthy, abs=1e-4)


def test_an_effect_changes_neither_noise_nor_input() -> None:
    """A case less what its effect changes is the clean case of its seed."""
    high = made("lower.y.offset-high")
    plain = made(seed=high.drawn)
    offset = high.planted[0].built.names["offset"]
    ours, clean = (c.readings for c in (high, plain))
    assert ours["u [V]"].tolist() == clean["u [V]"].tolist()
    assert ours["y [V]"] - offset == pytest.approx(clean["y [V]"], abs=10.0 / 4096.0)


def test_two_effects_hide_each_other() -> None:
    """Each is clear alone; together they show little."""
    both = case(1, "pump.dead-band", "lower.y.offset-high", group="hiding")
    alone = [rms(one.change["lower"]) for one in both.planted]
    assert rms(changed(both)["lower"]) < HIDES * math.hypot(*alone)


def test_parameters_lie_within_what_module_types_state() -> None:
    stated = {}
    for module in ("open-tank", "voltage-pump"):
        form = plain_yaml(ROOT / "kb" / "modules" / f"{module}.yaml")
        for name, part in form["parameters"].items():
            stated[name] = part["value"], part["u"], part["unit"]
    assert {name: stated[name][2] for name in UNITS} == UNITS
    for seed in range(20):
        for name, (value, _) in parameters(build(CASCADED, seed, 20)).items():
            middle, u, _ = stated[name.partition(".")[2]]
            assert abs(value - middle) <= 2.0 * u, name


@pytest.mark.parametrize("layout", [CASCADED, ROW], ids=lambda layout: layout.name)
def test_recordings_have_the_columns_of_their_plant(layout: Layout, tmp_path: Path) -> None:
    case(3, samples=60, layout=layout).write(tmp_path)
    with (tmp_path / "recording.csv").open(encoding="utf-8", newline="") as file:
        header = next(csv.reader(file))
    columns = plain_yaml(tmp_path / "plant" / "columns.yaml")
    assert header == [column["from"] for column in columns["columns"].values()]


SHORT = 90
RANDOM = np.random.default_rng(5)


def test_gain_is_that_of_the_full_covariance() -> None:
    """With and without other effects, whose flat prior is a very wide one; the effect's own
    direction among them leaves nothing, dependent ones do no harm."""
    d, slopes, flat = (RANDOM.normal(size=s) for s in (30, (30, 5), (30, 2)))
    slopes[:, 0] *= 1e3  # a parameter of which nothing is known
    for others in (flat, flat[:, :0]):
        covariance = np.eye(30) + slopes @ slopes.T + 1e8 * others @ others.T
        expected = 0.5 * d @ np.linalg.solve(covariance, d)
        assert expected == pytest.approx(expected_gain(d, slopes, others), rel=1e-5)
    assert expected_gain(d, slopes, d[:, None]) == pytest.approx(0.0, abs=1e-12)
    doubled = np.column_stack([flat, 3.0 * flat, 0.0 * flat])
    assert expected_gain(d, slopes, doubled) == pytest.approx(expected_gain(d, slopes, flat))


def test_answer_is_sealed() -> None:
    """By the digest of the text that is shown later. A weaker effect has less gain."""
    one, other = (made("upper.power-high", strength=s).answer for s in (0.3, 0.03))
    assert other.effects[0].gain < 0.1 * one.effects[0].gain
    assert one.digest != other.digest
    assert hashlib.sha256(one.to_json().encode()).hexdigest() == one.digest


def test_what_is_written_tells_nothing(tmp_path: Path) -> None:
    """The folder of a planted case is that of a clean one, but for the readings."""
    written = {}
    for name, one in (("planted", made("upper.overflow-sharp")), ("clean", made())):
        one.write(tmp_path / name)
        files = [f for f in (tmp_path / name).rglob("*") if f.is_file()]
        written[name] = {str(f.relative_to(tmp_path / name)): f.read_bytes() for f in files}
    planted, clean = written["planted"], written["clean"]
    assert {"recording.csv", "plant/plant.yaml", "plant/columns.yaml"} == set(planted)
    assert planted.pop("recording.csv") != clean.pop("recording.csv")
    assert planted == clean
    assert not any(b"overflow" in content for content in planted.values())


def test_rows_are_of_all_kinds_and_plants_that_the_tool_accepts(tmp_path: Path) -> None:
    """Two to four tanks, of which the last is measured, and some others; some metered."""
    layouts = [row(seed) for seed in range(30)]
    assert all(one.tanks[-1] in one.measured for one in layouts)
    assert {2, 3, 4} == {len(one.tanks) for one in layouts}
    assert {1, 2} <= {len(one.measured) for one in layouts}
    for metered in (True, False):
        layout = next(one for one in layouts if one.metered == metered)
        assert rulec(["check", str(write_plant(layout, tmp_path / str(metered)))]) == 0


QUALITY = ("stuck-reading", "coarse-steps")
"""What is told of a reading by itself, without an entry."""


def test_the_catalogue_knows_every_name() -> None:
    for effect in EFFECTS:
        for stated in effect.stated.get("right", ()):
            if stated.get("name") in (None, *QUALITY):
                continue
            (file,) = ROOT.glob(f"kb/*ts/{stated['name']}.yaml")
            parameters = set(plain_yaml(file).get("parameters", {"x": None}))
            assert set(stated.get("parameters", ())) <= parameters, stated["name"]


@pytest.mark.prove
def test_places_of_the_key_are_places_of_the_tool() -> None:
    """Of the shipped plant; `y` of a level that is not measured is never one."""
    _, builder = open_builder(ROOT / "plants" / CASCADED.name)
    known = {f"{c.module}.{c.place}" for c in builder.candidates} | {"lower.h", "upper.h"}
    for effect in possible_effects(CASCADED):
        (one,) = made(effect).planted
        assert set(right(one.placed, one.built)["places"]) <= known, effect


def test_parameters_are_those_of_the_entry() -> None:
    """In its unit: what is caught as share, the width as half of it, a share in percent."""
    tank = made("upper.overflow-sharp").plant.tanks["upper"]
    (overflow,) = made("upper.overflow-sharp").answer.effects
    assert overflow.names == ("overflow-caught",)
    expected = {"l_o": tank["rim"], "f": tank["caught"]}
    assert overflow.parameters["overflow-caught"] == pytest.approx(expected)
    clogged = made("lower.clogging")
    clog = clogged.plant.tanks["lower"]["clog"]
    (clogging,) = clogged.answer.effects
    assert clogging.parameters["blockage"]["x"] == pytest.approx(100.0 * clog)
    assert clogged.answer.verdict == "fault"


def test_what_no_entry_names_is_unnamed_and_has_a_place() -> None:
    """Also where it is an error of a sensor."""
    answer = made("lower.y.jet").answer
    (jet,) = answer.effects
    assert (jet.names, jet.sort, jet.places) == ((), "unnamed", ("lower.y",))
    assert answer.verdict == "unnamed"


def test_suite_is_a_list_that_depends_on_its_seed() -> None:
    """Each case of each group alone; all can be sent to another process."""
    groups = [group for group in STATED["tanks"] if group not in HARD]
    count = dict.fromkeys(groups, 6)
    planned = list(cases(1, count))
    assert planned == list(cases(1, count)) == pickle.loads(pickle.dumps(planned))
    assert planned != list(cases(2, count))
    assert len(planned) == 6 * len(groups) == len({p.name for p in planned})
    for one in planned:
        assert set(one.effects) <= set(possible_effects(one.layout))
        assert (one.group == "clean") == (one.effects == ())
        assert one.strength is None or WEAKEST <= one.strength <= STRONGEST
        assert one.group != "corner" or one.rarely == RARELY
    assert list(cases(1, {"clean": 6})) == [p for p in planned if p.group == "clean"]


def test_planned_cases_can_be_made() -> None:
    """Of a row that is drawn, as short as a test needs."""
    planned = next(p for p in cases(1, {"sensor": 9}, SHORT) if p.layout != CASCADED)
    answer = planned.make().answer
    assert (planned.name, "dynamic", SHORT) == (answer.case, answer.half, answer.samples)
