"""Which effects fit which places: by what equations are, never by name."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.effects.places import Site
from rulec.passes.types import Compilation
from tests.conftest import ROOT
from tests.effects import driver, effect, join, parameter, with_effects
from tests.test_amend import opened

Opened = tuple[Compilation, Ruleset, ModelBuilder]


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


def site(builder: ModelBuilder, module: str, kind: str, name: str) -> Site:
    return next(s for s in builder.matches.sites[module] if s.key == (kind, name))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("warm-slip", {"A.Q_geo", "B.Q_geo", "C.Q_geo", "D.Q_geo", "E.Q_geo"}),
        ("laminar-part", {f"{m}.plant" for m in "ABCDE"} | {"M1.resis", "M2.resis"}),
        ("cracking", {f"{m}.dp_mod" for m in "ABCDE"} | {"M1.loss", "M2.loss"}),
        ("wear", {f"{m}.Q_geo" for m in "ABCDE"}),
    ],
)
def test_places_on_the_rig(rig: Opened, name: str, expected: set[str]) -> None:
    """Slips, lines and static heads are told apart by the sign of a slope."""
    assert expected == places(rig[2], name)


def test_what_a_place_is(rig: Opened) -> None:
    """Dimension, readings, slopes and observers of a few places."""
    geo = site(rig[2], "A", "definition", "Q_geo")
    assert {"n", "dp"} == geo.reads
    assert geo.slopes["dp"] < 0 < geo.slopes["n"]
    assert ("A.pump", "A.power") == geo.observers
    assert not geo.measured
    loss = site(rig[2], "A", "definition", "loss")
    assert loss.measured
    assert {"dp_mod"} == loss.uses
    assert ("M1.resis", "A.plant", "B.plant", "C.plant") == (
        site(rig[2], "M1", "signal", "dp").observers
    )


def test_a_slip_is_no_estimate_of_the_flow(rig: Opened) -> None:
    """It gives a flow that rises with the pressure, but is taken off: no place for a line's law."""
    slip = site(rig[2], "A", "definition", "Q_slip")
    assert slip.slopes["dp"] > 0
    assert slip.moves["pump"] < 0
    assert "A.Q_slip" not in places(rig[2], "laminar-part")


def test_every_reading_that_counts_may_be_off(rig: Opened) -> None:
    """Signals that no observer reads are left out."""
    assert {f"{m}.{s}" for m in "ABCDE" for s in ("n", "dp", "P_el")} | {"M1.dp", "M2.dp"} == (
        places(rig[2], "offset")
    )


def test_a_driver_behind_the_module(station: Opened) -> None:
    """Total flow of the channel drives the head of each of its feeders, and of all alike."""
    found = [c for c in station[2].candidates if c.name == "shared-header"]
    assert {"head"} == {c.place for c in found}
    assert [8] == [len(c.members) for c in found if c.members]
    assert 9 == len(found)
    assert {"channel.Q"} == {c.drivers["F"] for c in found}
    equation = "head = z - downstream(l_suction) + k*Q**2 + k_2*channel.Q**2"
    assert equation == found[0].equation


def test_a_driver_in_another_module(rig: Opened) -> None:
    """Where the module has no thermometer, those of its neighbours are tried, the near ones."""
    models, _, builder = rig
    cold = effect(
        "cold-line",
        join("law*(1 + b*(T - T0))", gives="volume flow", rises_with="dp"),
        drivers={"dp": driver("pressure difference"), "T": driver("temperature", "plant")},
        parameters={"b": parameter(), "T0": parameter(None, of="T", fixed=True)},
    )
    own = ModelBuilder(with_effects(models, cold), builder._readings)
    ids = [c.id for c in own.candidates if c.name == "cold-line" and not c.members]
    assert "A.cold-line@plant" in ids
    assert [f"M1.cold-line@resis(dp, {m}.T)" for m in "ABCDE"] == [i for i in ids if "M1" in i]


def test_what_is_not_measured_is_told(station: Opened) -> None:
    """An effect that lacks a driver is no candidate, but a hint which sensor would make it one."""
    models, _, builder = station
    warm = effect(
        "warm",
        join("law*(1 + b*T)", gives="electric power", measured=False),
        drivers={"T": driver("temperature")},
        parameters={"b": parameter()},
    )
    own = ModelBuilder(with_effects(models, warm), builder._readings)
    assert set() == places(own, "warm")
    lacking = [(m.module, m.place, m.quantity) for m in own.missing]
    assert ("P11", "P_law", "temperature") in lacking
    assert all(m.sensor for m in own.missing)


def test_a_reading_that_another_join_does_without_is_not_missed(station: Opened) -> None:
    """Of several joins the one that lacks least says what to measure, and none if one fits."""
    models, _, builder = station
    drivers = {"T": driver("temperature"), "M": driver("torque"), "f": driver("frequency")}

    def missed(*laws: str) -> set[str]:
        joins = (join(law, gives="electric power", measured=False) for law in laws)
        entry = effect("warm", *joins, drivers=drivers, parameters={"b": parameter()})
        own = ModelBuilder(with_effects(models, entry), builder._readings)
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


METERING = """\
module: metering
version: 1
title: Metering pump whose law reads no pressure
signals:
  n:  {quantity: rotational speed, unit: rpm, sensor: converter-speed, input: true, reference: 900}
  dp: {quantity: pressure difference, unit: bar, sensor: piezoresistive, range: [0, 10],
       reference: 2}
  Q:  {quantity: volume flow, unit: l/h, sensor: magnetic-inductive, range: [0, 1000],
       reference: 500}
parameters:
  V:  {value: 9.26, unit: ml/rev, u: 0.1, source: data sheet}
  k2: {value: 8.0e-6, unit: bar/(l/h)**2, u: 1.0e-6, source: data sheet}
observers:
  meter: {component: line, Q: Q, reference: true, source: flow meter}
  pump:  {component: pump, Q: n*V, source: displacement}
  line:  {component: line, Q: sqrt(dp/k2), source: quadratic}
"""


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


def test_a_law_that_reads_no_pressure_may_follow_one(rig: Opened, tmp_path: Path) -> None:
    """The gauge is read by the line; a pump whose law reads it has the slip by that already."""
    shutil.copytree(ROOT / "kb", tmp_path / "kb")
    (tmp_path / "kb" / "modules" / "metering.yaml").write_text(METERING)
    text = "plant: metered\ntitle: Metered\nmodules: {A: {type: metering}}\nconnections: []\n"
    (tmp_path / "plant.yaml").write_text(text)
    _, builder = open_builder(tmp_path)
    for name in ("slip-linear", "bypass-flow"):
        found = [c for c in builder.candidates if c.name == name]
        assert [("pump", {"n": "A.n", "p": "A.dp"})] == [(c.place, dict(c.drivers)) for c in found]
    beside = effect(
        "beside",
        join("law - c*p", gives="volume flow", rises_with="n"),
        drivers={
            "n": driver("rotational speed"),
            "p": driver("pressure difference", "beside"),
        },
        parameters={"c": parameter()},
    )
    own = ModelBuilder(with_effects(rig[0], beside), rig[2]._readings)
    assert set() == places(own, "beside")


def test_an_effect_joins_a_place_once(rig: Opened) -> None:
    """The first join that fits counts; ids are unique in the plant."""
    models, _, builder = rig
    twice = effect(
        "twice",
        join("law*(1 + a)", gives="volume flow", falls_with="dp"),
        join("law*(1 - a)", gives="volume flow", falls_with="dp"),
        drivers={"dp": driver("pressure difference")},
        parameters={"a": parameter()},
    )
    own = ModelBuilder(with_effects(models, twice), builder._readings)
    assert 5 == sum(c.name == "twice" for c in own.candidates if not c.members)
    ids = [c.id for c in builder.candidates]
    assert len(ids) == len(set(ids))
    unknowns = [u.id for c in builder.candidates for u in c.unknowns]
    assert len(unknowns) == len(set(unknowns))


def test_a_law_without_a_value_is_left_out(rig: Opened) -> None:
    """At rest this pump delivers nothing, and nothing cannot divide; others have a slip then."""
    models, _, builder = rig
    bad = effect(
        "bad",
        join(
            "law + a/law_1",
            gives="volume flow",
            falls_with="dp",
            substitutes={"law_1": {"n": "0"}},
        ),
        drivers={"dp": driver("pressure difference"), "n": driver("rotational speed")},
        parameters={"a": parameter()},
    )
    own = ModelBuilder(with_effects(models, bad), builder._readings)
    assert {f"{m}.Q_geo" for m in "ABCD"} == places(own, "bad")


def test_faults_of_the_library_are_candidates(rig: Opened) -> None:
    """With the ids of the ruleset, undone by their degree."""
    _, ruleset, builder = rig
    found = {c.id: c for c in builder.candidates if c.sort == "fault"}
    assert {f.id for f in ruleset.faults} == set(found)
    for fault in ruleset.faults:
        assert set(fault.affects) == set(found[fault.id].observers)
    assert "loss = (dp_mod - k0)/(x + 1)" == found["A.clogging"].equation


def test_spots_of_a_dosing_module(rig: Opened) -> None:
    """Of places that move all observers alike one is kept, the outermost."""
    spots = [s.id for s in rig[2].spots if s.module == "A"]
    assert [
        "definition:A.Q_geo",
        "definition:A.P_law",
        "definition:A.loss",
        "signal:A.n",
        "signal:A.dp",
        "signal:A.P_el",
    ] == spots
    assert ["definition:M1.loss", "signal:M1.dp"] == [
        s.id for s in rig[2].spots if s.module == "M1"
    ]


def test_order_does_not_depend_on_the_order_of_effects(rig: Opened) -> None:
    """The same input gives the same candidates in the same order."""
    _, _, again = opened("mixing-rig")
    assert rig[2].candidates == again.candidates
    assert rig[2].missing == again.missing
    assert rig[2].spots == again.spots
