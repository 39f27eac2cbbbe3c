"""Cases of the truth of tanks: effects act, answers are complete, nothing depends on luck."""

from __future__ import annotations

import functools
import json
import math
from pathlib import Path

import pytest
import yaml

from rulec.prove.truth.tanks import (
    CASCADED,
    GROUPS,
    ROW,
    Case,
    build,
    case,
    named,
    plant_folder,
    possible_effects,
)
from rulec.prove.truth.tanks.__main__ import main
from rulec.prove.truth.tanks.build import UNITS
from rulec.prove.truth.tanks.case import FURTHER, HIDES
from rulec.prove.truth.tanks.describe import parameters
from rulec.prove.truth.tanks.size import ACCEPTED
from tests.conftest import ROOT

SHORT = 120
"""Samples of a case that is made for one test."""


@functools.cache
def short(effects: tuple[str, ...], seed: int = 3) -> Case:
    return case(seed, effects, SHORT)


@pytest.mark.parametrize("effect", possible_effects(CASCADED))
def test_each_effect_acts(effect: str) -> None:
    """Of the size that was sought, alone, on some reading; and never without a cause."""
    made = short((effect,))
    (truth,) = made.answer.effects
    least, most = ACCEPTED
    assert least <= max(truth.shown.values()) <= most
    assert truth.shown == made.answer.shown
    assert truth.present > 0.02
    y, u = (made.recording.readings[name] for name in ("y [V]", "u [V]"))
    assert -0.4 < y.min() < y.max() < 10.0
    assert 0.0 <= u.min() < u.max() <= 10.0


@pytest.mark.parametrize("effect", ["middle.overflow-sharp", "inflow.lag", "first.y.jet"])
def test_effects_act_in_the_row(effect: str) -> None:
    """Of an unmeasured tank, of the feed, of one of two sensors."""
    made = case(3, (effect,), SHORT, ROW)
    rms = made.answer.shown
    assert ACCEPTED[0] <= max(rms.values()) <= ACCEPTED[1]
    assert (rms["first.y"] == 0.0) == (effect == "middle.overflow-sharp")
    assert (rms["last.y"] == 0.0) == (effect == "first.y.jet")


@pytest.mark.parametrize("effect", ["upper.leak", "lower.clogging"])
def test_faults_begin(effect: str) -> None:
    """Before its time a fault changes nothing, afterwards it does."""
    made = short((effect,))
    (truth,) = made.answer.effects
    assert truth.period is not None
    plain = short((), seed=made.answer.seed + made.answer.attempt * FURTHER)
    same = made.recording.truth["lower.h [cm]"] == pytest.approx(
        plain.recording.truth["lower.h [cm]"], abs=1e-4
    )
    assert not same
    before = made.recording.readings["time [s]"] < truth.period[0]
    for name in ("upper.h [cm]", "lower.h [cm]"):
        healthy, faulty = (c.recording.truth[name] for c in (plain, made))
        assert faulty[before] == pytest.approx(healthy[before], abs=1e-4)
        assert 0.2 < before.mean() < 0.8


def test_an_effect_changes_neither_noise_nor_input() -> None:
    """A case less what its effect changes is the clean case of its seed."""
    made = short(("lower.y.offset-high",))
    plain = short((), seed=made.answer.seed + made.answer.attempt * FURTHER)
    offset = made.answer.effects[0].parameters["offset"][0]
    ours, clean = (c.recording.readings for c in (made, plain))
    assert ours["u [V]"].tolist() == clean["u [V]"].tolist()
    assert ours["y [V]"] - offset == pytest.approx(clean["y [V]"], abs=10.0 / 4096.0)


def test_two_effects_hide_each_other() -> None:
    """Each is clear alone; together they show little."""
    made = case(1, ("pump.dead-band", "lower.y.offset-high"), SHORT, hiding=True)
    assert made.answer.hiding is not None
    assert made.answer.hiding < HIDES
    alone = [truth.shown["lower.y"] for truth in made.answer.effects]
    assert math.hypot(*alone) * made.answer.hiding == pytest.approx(
        made.answer.shown["lower.y"], abs=1e-3
    )


def test_same_seed_same_bytes(tmp_path: Path) -> None:
    """Also of the answer; another seed gives another plant."""
    written = {}
    for folder, seed in (("one", 4), ("again", 4), ("other", 5)):
        made = case(seed, ("upper.seepage",), 60, name="it")
        made.write(tmp_path / folder)
        written[folder] = {f.name: f.read_bytes() for f in (tmp_path / folder).iterdir()}
    assert {"it.csv", "it.truth.csv", "it.answer.json"} == set(written["one"])
    assert written["one"] == written["again"]
    assert all(written["one"][name] != written["other"][name] for name in written["one"])


@pytest.mark.parametrize("effects", [(), ("upper.leak",), ("lower.y.stuck", "upper.vortex")])
def test_answers_are_complete(effects: tuple[str, ...]) -> None:
    """All that was planted, drawn and measured, with units, as text that can be read again."""
    answer = json.loads(short(effects).answer.to_json())
    assert set(effects) == {f"{e['module']}.{e['effect']}" for e in answer["effects"]}
    expected = {0: "none", 1: "fault", 2: "unnamed"}[len(effects)]
    assert expected == answer["verdict"]
    assert {"pump.k", "lower.g"} <= set(answer["parameters"])
    assert {"pump.u.zero", "lower.y.zero", "lower.y.noise"} <= set(answer["sensing"])
    for truth in answer["effects"]:
        assert truth["parameters"]
        assert (truth["period"] is not None) == (truth["effect"] in ("leak", "stuck"))
        assert {"lower.y"} == set(truth["shown"])
        assert set(truth) >= {"title", "sort", "present", "twins"}
    values = [
        answer["parameters"],
        answer["sensing"],
        *(e["parameters"] for e in answer["effects"]),
    ]
    for name, stated in (item for part in values for item in part.items()):
        assert math.isfinite(stated["value"]), name
        assert stated["unit"], name


def test_parameters_lie_within_what_module_types_state() -> None:
    """The truth stays within two uncertainties of the numbers of the knowledge base."""
    stated = {}
    for module in ("open-tank", "voltage-pump"):
        text = (ROOT / "kb" / "modules" / f"{module}.yaml").read_text(encoding="utf-8")
        for name, part in yaml.safe_load(text)["parameters"].items():
            stated[name] = part["value"], part["u"], part["unit"]
    assert {name: stated[name][2] for name in UNITS} == dict(UNITS)
    for seed in range(20):
        for name, (value, _) in parameters(build(CASCADED, seed, 20)).items():
            middle, u, _ = stated[name.partition(".")[2]]
            assert abs(value - middle) <= 2.0 * u, name


def test_named_cases_are_a_list() -> None:
    """Every group, names that differ, effects that exist; a second round has other seeds."""
    cases = list(named(2))
    assert len(cases) == len({c.name for c in cases}) == len({c.seed for c in cases})
    assert set(GROUPS) == {c.group for c in cases}
    for one in cases:
        assert set(one.effects) <= set(possible_effects(one.layout))
        assert (one.group == "clean") == (one.effects == ())
    every = {e for c in cases if c.layout == CASCADED for e in c.effects}
    assert every == set(possible_effects(CASCADED))


def test_command_writes_a_case_and_its_plant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The recording has the columns that the plant's file of columns names."""
    main(["one", "middle.leak", "--plant", "tank-row", "--samples", "60", "-o", str(tmp_path)])
    file = Path(capsys.readouterr().out.split()[0])
    header = file.read_text(encoding="utf-8").splitlines()[0].split(",")
    columns = yaml.safe_load((tmp_path / "tank-row" / "columns.yaml").read_text(encoding="utf-8"))
    assert header == [column["from"] for column in columns["columns"].values()]
    assert "fault" == json.loads(file.with_suffix(".answer.json").read_text())["verdict"]
    cascaded = yaml.safe_load((plant_folder(CASCADED, tmp_path) / "columns.yaml").read_text())
    assert list(short(()).recording.readings) == [c["from"] for c in cascaded["columns"].values()]


def test_unknown_effects_are_refused() -> None:
    """With the names that are known."""
    with pytest.raises(ValueError, match=r"no effect 'lower\.lek'; known: .*lower\.leak"):
        case(1, ("lower.lek",))
