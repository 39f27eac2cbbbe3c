"""Cases of the truth of tanks: effects act, columns fit the plant, nothing depends on luck."""

import csv
import functools
import math
from pathlib import Path

import numpy as np
import pytest

from rulec.prove.truth.sealed import HIDES
from rulec.prove.truth.tanks.build import CASCADED, Layout, build
from rulec.prove.truth.tanks.effect import possible_effects
from rulec.prove.truth.tanks.effect_size import ACCEPTED, Readings, change_of, rms, run
from rulec.prove.truth.tanks.plan import Case
from rulec.prove.truth.tanks.sensing import shown
from tests.conftest import ROOT, plain_yaml
from tests.tank_row import ROW, UNITS, case, parameters

NOISE = 0.03
"""V; a larger change is seen."""


@functools.cache
def short(effects: tuple[str, ...], seed: int = 3) -> Case:
    return case(seed, *effects)


def changed(made: Case) -> Readings:
    """What all effects of a case change together, V, by tank."""
    plain = shown(made.setup.plant, made.setup.course)
    return change_of(shown(made.plant, run(made.setup, made.plant)), plain)


@pytest.mark.parametrize("effect", possible_effects(CASCADED))
def test_each_effect_acts(effect: str) -> None:
    """Of the size that was sought, alone, on some reading; and never without a cause."""
    made = short((effect,))
    (one,) = made.planted
    assert one.placed.id == effect
    least, most = ACCEPTED
    assert least <= rms(one.change["lower"]) <= most
    assert one.change["lower"] == pytest.approx(changed(made)["lower"], abs=1e-6)
    assert np.mean(np.abs(one.change["lower"]) > NOISE) > 0.02
    y, u = (made.readings[name] for name in ("y [V]", "u [V]"))
    assert -0.4 < y.min() < y.max() < 10.0
    assert 0.0 <= u.min() < u.max() <= 10.0


@pytest.mark.parametrize("effect", ["middle.overflow-sharp", "inflow.lag", "first.y.jet"])
def test_effects_act_in_the_row(effect: str) -> None:
    """Of an unmeasured tank, of the feed, of one of two sensors."""
    made = case(3, effect, layout=ROW)
    off = {tank: round(rms(values), 4) for tank, values in changed(made).items()}
    assert ACCEPTED[0] <= max(off.values()) <= ACCEPTED[1]
    assert (off["first"] == 0.0) == (effect == "middle.overflow-sharp")
    assert (off["last"] == 0.0) == (effect == "first.y.jet")


@pytest.mark.parametrize("effect", ["upper.leak", "lower.clogging"])
def test_faults_begin(effect: str) -> None:
    """Before that a fault changes nothing, afterwards it does."""
    made = short((effect,))
    upper, lower = made.plant.tanks
    fault = upper.leak or lower.clog
    assert fault is not None
    plain = short((), seed=made.drawn)
    before = made.readings["time [s]"] < fault.begin
    assert 0.2 < before.mean() < 0.8
    for tank in (0, 1):
        healthy, faulty = (run(c.setup, c.plant).levels[:, tank] for c in (plain, made))
        assert faulty[before] == pytest.approx(healthy[before], abs=1e-4)
    assert faulty != pytest.approx(healthy, abs=1e-4)


def test_an_effect_changes_neither_noise_nor_input() -> None:
    """A case less what its effect changes is the clean case of its seed."""
    made = short(("lower.y.offset-high",))
    plain = short((), seed=made.drawn)
    offset = made.planted[0].built.values["offset"]
    ours, clean = (c.readings for c in (made, plain))
    assert ours["u [V]"].tolist() == clean["u [V]"].tolist()
    assert ours["y [V]"] - offset == pytest.approx(clean["y [V]"], abs=10.0 / 4096.0)


def test_two_effects_hide_each_other() -> None:
    """Each is clear alone; together they show little."""
    made = case(1, "pump.dead-band", "lower.y.offset-high", group="hiding")
    alone = [rms(one.change["lower"]) for one in made.planted]
    assert rms(changed(made)["lower"]) < HIDES * math.hypot(*alone)


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
