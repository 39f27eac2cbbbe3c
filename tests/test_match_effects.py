"""Which effects fit which places: by what equations are, never by name."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from rulec.effects.model_builder import ModelBuilder, open_builder
from tests.conftest import ROOT
from tests.test_amend import Opened, driver, effect, join, opened, parameter, with_effects


@pytest.fixture(scope="module")
def rig() -> Opened:
    return opened("mixing-rig")


@pytest.fixture(scope="module")
def station() -> Opened:
    return opened("hsy-pumping")


def places(builder: ModelBuilder, name: str) -> set[str]:
    """Where an effect was joined, as ``module.place``."""
    return {f"{c.module}.{c.place}" for c in builder.candidates if c.name == name}


def pump_loop(folder: Path) -> Path:
    """Plant file of the rig, with its own module type beside it."""
    rigs = ROOT / "tests" / "rig" / "plants"
    plant = Path(shutil.copytree(rigs / "pump-loop", folder / "pump-loop"))
    (plant / "kb").mkdir()
    shutil.copyfile(rigs / "types" / "loop-pump.yaml", plant / "kb" / "loop-pump.yaml")
    return plant / "plant.yaml"


def test_a_driver_behind_the_module(station: Opened) -> None:
    """Total flow of the channel drives the head of each of its feeders, and of all alike."""
    found = [c for c in station[2].candidates if c.name == "shared-header"]
    assert {"head"} == {c.place for c in found}
    assert [8] == [len(c.members) for c in found if c.members]
    assert 9 == len(found)
    assert {"channel.Q"} == {c.drivers["F"] for c in found}
    equation = "head = z - downstream(l_suction) + k*Q**2 + k_2*channel.Q**2"
    assert equation == found[0].equation


def test_a_reading_that_another_join_does_without_is_not_missed(station: Opened) -> None:
    """An effect that lacks a driver is no candidate, but a hint which sensor would make it one. Of
    several joins the one that lacks least says what to measure, and none if one fits."""
    models, _, builder = station
    drivers = {"T": driver("temperature"), "M": driver("torque"), "f": driver("frequency")}

    def missed(*laws: str) -> set[str]:
        joins = (join(law, gives="electric power", measured=False) for law in laws)
        entry = effect("warm", *joins, drivers=drivers, parameters={"b": parameter()})
        own = ModelBuilder(with_effects(models, entry), builder._readings)
        assert all(m.sensor for m in own.missing)
        return {m.quantity for m in own.missing if m.place == "P_law"}

    assert {"temperature", "torque"} == missed("law*(1 + b*T*M)")
    assert {"temperature"} == missed("law*(1 + b*T*M)", "law*(1 + b*T)")
    assert set() == missed("law*(1 + b*T)", "law*(1 + b*f)")


def test_a_gauge_that_no_equation_reads_may_drive(tmp_path: Path) -> None:
    """The head is read, so it is none; a reading that the module does not have is not missed."""
    models, _, builder = opened(str(pump_loop(tmp_path)))
    gauge = effect(
        "gauge",
        join("law*(1 - k*p)", gives="pressure difference", falls_with="Q"),
        drivers={"Q": driver("volume flow"), "p": driver("pressure difference", "unread")},
        parameters={"k": parameter()},
    )
    own = ModelBuilder(with_effects(models, gauge), builder._readings)
    assert [{"Q": "pump.Q", "p": "pump.p_s"}] == [
        dict(c.drivers) for c in own.candidates if c.name == "gauge"
    ]
    models, _, builder = opened("esp-pump")
    own = ModelBuilder(with_effects(models, gauge), builder._readings)
    assert set() == places(own, "gauge")
    assert not [m for m in own.missing if m.name == "gauge"]


def test_a_calibration_that_turns_a_law_round_does_not_change_what_it_is(tmp_path: Path) -> None:
    """From one operating point a calibration cannot tell parameters apart, and may give a head
    that rises with the flow, where their signs are free; the law is that of a centrifugal pump
    all the same."""
    plant = pump_loop(tmp_path)
    expected = places(open_builder(plant)[1], "part-load-head")
    values = "{a0: {value: -0.02, unit: m2, u: 0.05}, a2: {value: -2.0e7, unit: 1/m**4, u: 2.0e7}}"
    calibration = (
        f"calibration: turned\nmodules:\n  pump: {{type: loop-pump, parameters: {values}}}\n"
    )
    (kind,) = tmp_path.rglob("loop-pump.yaml")
    text = kind.read_text(encoding="utf-8")
    kind.write_text(re.sub(r"(a[02]: .*), title", r"\1, sign: any, title", text), encoding="utf-8")
    (plant.parent / "turned.yaml").write_text(calibration, encoding="utf-8")
    text = plant.read_text(encoding="utf-8")
    plant.write_text(f"{text}calibration: [turned.yaml]\n", encoding="utf-8")
    assert expected == places(open_builder(plant)[1], "part-load-head") == {"pump.dp_law"}


def test_faults_of_the_library_are_candidates(rig: Opened) -> None:
    """With the ids of the ruleset, undone by their degree."""
    _, ruleset, builder = rig
    found = {c.id: c for c in builder.candidates if c.sort == "fault"}
    assert {f.id for f in ruleset.faults} == set(found)
    for fault in ruleset.faults:
        assert set(fault.affects) == set(found[fault.id].observers)
    assert "loss = (dp_mod - k0)/(x + 1)" == found["A.clogging"].equation
