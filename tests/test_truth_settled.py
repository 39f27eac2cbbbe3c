"""The independent truth of stationary plants: its numbers, its cases and their key."""

import functools
from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main as rulec
from rulec.prove.truth.settled.detection_limit import visible_outputs
from rulec.prove.truth.settled.effect import EFFECTS, WIRING
from rulec.prove.truth.settled.operated_plant import scene
from rulec.prove.truth.settled.plan import Planned, SettledCase
from rulec.prove.truth.settled.rig import PUMPS
from rulec.prove.truth.settled.rigs import drawn_rig
from rulec.prove.truth.settled.suite import FULL, planned
from rulec.prove.truth.streams import stream
from rulec.prove.truth.units import BAR, LITRE_PER_HOUR
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
def alone(effect: str, family: str = "dosing", aim: float = 1000.0) -> SettledCase:
    return Planned(f"test {effect}", "single", family, "steps", (effect,), aim, small=True).make()


def test_a_written_case_tells_nothing(tmp_path: Path) -> None:
    """And the tool accepts the plant."""
    alone("slip-warm").write(tmp_path)
    files = {str(p.relative_to(tmp_path)): p for p in tmp_path.rglob("*") if p.is_file()}
    assert {"plant/plant.yaml", "recording.csv"} == set(files)
    assert not any(b"slip" in file.read_bytes() for file in files.values())
    assert rulec(["check", str(tmp_path / "plant")]) == 0


def head_of(folder: Path) -> str:
    """Headers of a written recording."""
    return (folder / "recording.csv").read_text(encoding="utf-8").partition("\n")[0]


def test_what_is_not_recorded_has_no_column(tmp_path: Path) -> None:
    plan = Planned(
        "test hidden", "unrecorded", "dosing", "steps", ("slip-warm",), 2000.0, small=True
    )
    case = plan.make()
    assert ("unnamed", "T") == (case.answer.verdict, case.answer.unrecorded)
    case.write(tmp_path)
    assert ".T " not in head_of(tmp_path)


@pytest.mark.parametrize("effect", ["slip-warm", "laminar", "power-warm"])
def test_what_is_visible_grows_with_the_size(effect: str) -> None:
    """As aimed; nothing is visible of nothing."""
    for aim in (30.0, 1000.0):
        case = alone(effect, aim=aim)
        (planted,) = case.answer.effects
        assert 0.6 * aim < planted.gain < 1.7 * aim
    assert visible_outputs(case.scene).gain(()) == pytest.approx(0.0, abs=1e-9)


def test_a_drawn_plant_runs_at_all_of_its_speeds() -> None:
    for seed in range(20):
        rig = drawn_rig("dosing", stream(seed, "rig"))
        drawn = scene(rig, seed, 60, "steps")
        assert all(np.all(drawn.plain[f"{m}.Q"] > 0) for m in rig.pumps)


def test_the_suite_has_as_many_cases_as_it_says() -> None:
    """Each with a name of its own; the same seed gives the same list."""
    cases = list(planned(3, FULL))
    assert sum(FULL.values()) == len({c.name for c in cases})
    assert cases == list(planned(3, FULL))
    assert FULL["clean"] >= 100


@pytest.mark.parametrize(
    ("family", "effect", "there", "absent"),
    [
        ("bench", "cavitation", "A.p_s [bar]", "A.l [mm]"),
        ("valve", "quick", "A.x [%]", "A.P_el [W]"),
    ],
)
def test_a_metered_pump_and_a_valve_are_plants_of_their_own(
    family: str, effect: str, there: str, absent: str, tmp_path: Path
) -> None:
    """With readings of their own; the tool accepts the plant."""
    alone(effect, family).write(tmp_path)
    assert rulec(["check", str(tmp_path / "plant")]) == 0
    assert there in head_of(tmp_path)
    assert absent not in head_of(tmp_path)


def test_where_a_valve_chokes_it_passes_no_more() -> None:
    """At the largest pressure difference of IEC 60534-2-1 the flow stays, whatever lies behind."""
    case = alone("choked", "valve")
    (planted,) = case.answer.effects
    known = planted.parameters["choked-flow"]
    largest = known["F"] * (case.scene.around["A.p_1"] + known["p_v"] * BAR)
    across, truth = case.scene.given["A.dp"], case.scene.truly(case.terms)["A.Q"]
    beyond = across > largest
    assert 0.0 < beyond.mean() < 1.0
    plain = case.scene.plain["A.Q"]
    assert truth[~beyond] == pytest.approx(plain[~beyond])
    assert truth[beyond] == pytest.approx((plain * np.sqrt(largest / across))[beyond])


def test_what_a_pump_alone_has_is_planned_where_it_stands() -> None:
    """Metered pumps, warm oil sets and valves; with no effect of a dosing pump or a line."""
    for case in planned(3, {"single": 120, "pair": 40}):
        kinds = [EFFECTS[e].kinds for e in case.effects]
        for pump, family in (("metered", "bench"), ("oil-warm", "warm"), ("valve", "valve")):
            assert (case.family == family) == ((pump,) in kinds)
            if case.family == family:
                assert all(not k or pump in k for k in kinds)


def test_a_pressure_above_which_nothing_is_lost_is_where_cavitation_begins() -> None:
    """Absolute pressure less vapour: what is planted at a gauge pressure acts below it only."""
    case = alone("cavitation", "bench")
    (planted,) = case.answer.effects
    limit = planted.parameters["suction-cavitation"]["p_c"]
    lost = case.scene.plain["A.dp"] - case.scene.truly(case.terms)["A.dp"]
    below = case.scene.around["A.p_s"] / BAR < limit
    assert 0.1 < below.mean() < 0.6
    assert np.all(lost[below] > 0.0)
    assert lost[~below] == pytest.approx(0.0, abs=1e-3)
