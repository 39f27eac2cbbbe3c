"""Effects built into module types: where they join, what stands where, what the plan gives."""

import itertools
import re
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from rulec_runtime.contract.plan import Array

from rulec.commands.check_files import collect
from rulec.effects.candidate import Unknown
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.effects.places import parameter_values
from rulec.effects.write_module import write_module
from rulec.passes.lower import Lowering, lower_module
from tests.conftest import ROOT, compiled
from tests.test_adopt import PLANTS, WITHOUT, builder_of


def around(builder: ModelBuilder) -> dict[str, Array | float]:
    """Readings at random points around the reference, with the values of all parameters."""
    random = np.random.default_rng(1)
    values: dict[str, Array | float] = {**parameter_values(builder.network.plant)}
    for name, reading in builder._readings.items():
        values[name] = reading * (1.0 + 0.05 * random.standard_normal(40))
    return values


def flows(outputs: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    return ((name, value) for name, value in outputs.items() if name.startswith("q:"))


@pytest.mark.parametrize("plant", ["mixing-rig", "hsy-pumping", "zema-hydraulic"])
def test_lowered_equations_are_those_of_the_ruleset(plant: str) -> None:
    """Straight from the tree or by way of sympy: observers and guards agree to 1e-12."""
    ruleset, builder = compiled(plant), builder_of(PLANTS / plant)
    values = around(builder)
    inputs = dict.fromkeys(ruleset.plan.inputs, 1.0)
    expected = ruleset.plan.run({**inputs, **values})
    compared = 0
    for module in builder.network.plant.modules:
        plan = lower_module(Lowering(builder.network, {}), module)
        for name, value in plan.run(values).items():
            np.testing.assert_allclose(value, expected[name], rtol=1e-12)
            compared += 1
    assert compared == sum(1 + len(o.guards) for o in ruleset.observers)


@pytest.mark.parametrize(
    ("plant", "module"), [("mixing-rig", "A"), ("mixing-rig", "M1"), ("hsy-pumping", "P11")]
)
def test_at_the_null_the_plain_relation_comes_back(plant: str, module: str) -> None:
    """Every candidate at every place it fits, whatever its other parameters are. Faults of the
    library are candidates with the ids of the ruleset."""
    builder = builder_of(PLANTS / plant)
    values = around(builder) | {"time": 100.0}
    assert {f.id for f in compiled(plant).faults} == {
        c.id for c in builder.candidates if c.sort == "fault"
    }

    def shape(u: Unknown) -> float:
        return u.starts[0] if u.starts else float(np.ravel(values.get(u.driver or "", 1.0))[0])

    joining = [c for c in builder.candidates if c.module == module]
    assert len(joining) > 20
    plain = builder.plan(module, ()).run(values)
    for candidate in joining:
        own = {u.id: shape(u) if u.null is None else u.null for u in candidate.unknowns}
        joined = builder.plan(module, (candidate.id,)).run({**values, **own})
        for name, value in flows(plain):
            np.testing.assert_allclose(joined[name], value, rtol=1e-12, err_msg=candidate.id)


def test_slip_that_grows_with_temperature() -> None:
    """The plan of an amended module, against the formula written out by hand."""
    builder = builder_of(WITHOUT)
    values = around(builder)
    name = "main.slip-temperature@Q_law"
    out = builder.plan("main", (name,)).run({**values, f"{name}.b": 0.03, f"{name}.T0": 310.0})
    q0, c1 = values["main.Q0"], values["main.C1"]
    slip = c1 * values["main.dp"] * np.exp(0.03 * (values["main.T"] - 310.0))
    np.testing.assert_allclose(out["q:main.pump"], q0 - slip, rtol=1e-13)
    law = values["main.P0"] + values["main.P1"] * values["main.dp"]
    power = (q0 - slip) * values["main.P_el"] / law
    np.testing.assert_allclose(out["q:main.power"], power, rtol=1e-13)


def test_laws_of_a_line_stand_beside_each_other_in_any_order() -> None:
    """What one builds in may have no value at the flow of 0 at which another asks for the law.

    Friction over a flow divides by it: there the law beneath counts.
    """
    builder = builder_of(PLANTS / "hsy-pumping")
    own = [c for c in builder.candidates if c.module == "P11" and not c.members]
    names = [c.id for c in own if c.place == "head" and c.sort != "fault"]
    assert len(names) > 2
    laws = [builder.equation("P11", joined, "head") for joined in itertools.permutations(names, 3)]
    assert all("law" not in text and "/0" not in text for text in laws)


def test_a_corrected_reading_drives_what_is_joined_before_and_after() -> None:
    """The order of acceptance does not matter, and the reading counts everywhere as corrected."""
    builder = builder_of(PLANTS / "mixing-rig")
    values = around(builder)
    warm, offset = "A.slip-temperature@Q_geo", "A.offset-pressure@dp"
    own = {f"{warm}.b": 0.02, f"{warm}.T0": 290.0, f"{offset}.z": 2e4}
    one = builder.plan("A", (warm, offset)).run({**values, **own})
    other = builder.plan("A", (offset, warm)).run({**values, **own})
    true = {**values, "A.dp": values["A.dp"] - 2e4}
    expected = builder.plan("A", (warm,)).run({**true, **own})
    for name, value in flows(expected):
        np.testing.assert_allclose(one[name], value, rtol=1e-13)
        np.testing.assert_allclose(other[name], value, rtol=1e-13)


def test_base_parameters_carry_their_covariance() -> None:
    """Uncertain ones may be moved, with the correlations of the calibration; others are given."""
    base = builder_of(PLANTS / "mixing-rig").parameters
    assert set(base.ids) == set(base.sheet)
    index = {name: i for i, name in enumerate(base.ids)}
    first, second = index["M1.k0"], index["M1.k2"]
    assert "A.V" in base.constants
    assert "A.V" not in index
    scale = base.factors[first] * base.factors[second]
    file = ROOT / "plants" / "mixing-rig" / "calibration.yaml"
    (block,) = yaml.safe_load(file.read_text(encoding="utf-8"))["modules"]["M1"]["covariance"]
    expected = block["matrix"][block["of"].index("k0")][block["of"].index("k2")]
    assert base.covariance[first, second] / scale == pytest.approx(expected, rel=1e-3)
    assert 0.0 == base.covariance[first, index["A.k2"]]
    # What the data sheet says stands beside what was calibrated with it.
    value, u = base.sheet["A.k2"]
    assert (5.2e-6, 2.0e-8) == pytest.approx([v / base.factors[index["A.k2"]] for v in (value, u)])
    assert u > np.sqrt(base.covariance[index["A.k2"], index["A.k2"]])


def test_a_law_keeps_its_accuracy_where_its_error_looks_like_anothers() -> None:
    """An error of the head shifts the loss as far; as a place where something acts, one counts."""
    builder = builder_of(PLANTS / "rse-boiler")
    stated = {law.place: law.accuracy for law in builder.laws}
    assert {"head": 0.05, "opening": 0.1, "resistance": 0.08} == stated
    assert "head" not in {spot.place for spot in builder.locations}


@pytest.mark.parametrize(("share", "expected"), [(0.5, []), (-0.5, ["KB125"])])
def test_an_amended_type_says_what_its_new_parts_may_be(
    share: float, expected: list[str], tmp_path: Path
) -> None:
    """A share lies in its range; what a reading should be is no law that may be off by 5 %."""
    builder = builder_of(PLANTS / "rse-boiler")
    assert builder.sources is not None
    documents = builder.sources.by_kind["module"]
    (document,) = (d for d in documents if d.data["module"] == "pumped-valve-branch")
    (effect,) = (c for c in builder.candidates if c.name == "equal-percentage")
    kind = replace(builder.amended("boiler", (effect.id,)).type, name="own")
    values = {"s": share, "R": 30.0}
    brought = {n: replace(kind.parameters[n], value=v, u=0.1) for n, v in values.items()}
    text = write_module(document, kind, brought, [])
    (tmp_path / "kind.yaml").write_text(text, encoding="utf-8")
    assert expected == [d.code for d in collect([tmp_path])]
    assert "range: [3, 300]" in text
    assert 'accuracy: "0 %, the class of the sensor says it"' in text


def test_a_calibration_that_turns_a_law_round_does_not_change_what_it_is(tmp_path: Path) -> None:
    """From one operating point a calibration cannot tell parameters apart, and may give a head
    that rises with the flow, where their signs are free; the law is that of a centrifugal pump
    all the same."""
    rigs = ROOT / "tests" / "rig" / "plants"
    plant = Path(shutil.copytree(rigs / "pump-loop", tmp_path / "pump-loop")) / "plant.yaml"
    (plant.parent / "kb").mkdir()
    shutil.copyfile(rigs / "types" / "loop-pump.yaml", plant.parent / "kb" / "loop-pump.yaml")

    def places() -> set[str]:
        found = (c for c in open_builder(plant)[1].candidates if c.name == "part-load-head")
        return {f"{c.module}.{c.place}" for c in found}

    expected = places()
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
    assert expected == places() == {"pump.dp_law"}
