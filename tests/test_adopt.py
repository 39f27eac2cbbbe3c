"""What a mismatch found, taken over into a plant folder that is used like any other."""

import functools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.cli import main
from rulec.effects.adopt import adoption_of
from rulec.effects.candidate import CurveTerm
from rulec.effects.free_form import curve_through
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.effects.places import parameter_values
from rulec.effects.repair import AdoptRefused, plant_of, read_form, repair_of
from rulec.effects.write_plant import put_in_place, write_plant
from rulec.language.read_yaml import parse_document, read_document
from rulec.language.write_yaml import flow, lines
from rulec.passes.lower import Lowering, lower_module
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from tests.conftest import ROOT

SLIP = "slip-temperature"
PLANTS = ROOT / "plants"
WITHOUT = PLANTS / "zema-hydraulic" / "without-temperature.yaml"
Found = Sequence[tuple[str, Mapping[str, float]]]


@functools.cache
def builder_of(plant: Path) -> ModelBuilder:
    """The builder of a plant, opened once."""
    return open_builder(plant)[1]


def mismatch(plant: Path, found: Found, **extra: Any) -> tuple[dict[str, Any], ModelBuilder]:
    """What `rulec mismatch` writes, as far as it is adopted; values by local names, SI.

    All uncertain parameters of the plain plant are moved by a tenth of their uncertainty.
    """
    builder = builder_of(plant)
    base, by_id = builder.parameters, {c.id: c for c in builder.candidates}
    joined, ids, values = [], [], []
    for name, given in found:
        candidate = by_id[name]
        unknowns = {u.id: given[u.name] for u in candidate.unknowns if not u.fixed}
        fixed = {u.id: given[u.name] for u in candidate.unknowns if u.fixed}
        joined.append({"id": name, "effect": candidate.name, "unknowns": unknowns, "fixed": fixed})
        ids += unknowns
        values += unknowns.values()
    n, m = len(base.ids), len(ids)
    covariance = np.zeros((n + m, n + m))
    covariance[:n, :n] = base.covariance
    covariance[n:, n:] = np.diag([(0.1 * v) ** 2 for v in values])
    moved = base.values + 0.1 * np.sqrt(np.diag(base.covariance))
    repair = {
        "plant": str(plant),
        "joined": joined,
        "parameters": [*base.ids, *ids],
        "values": [*moved.tolist(), *values],
        "covariance": covariance.tolist(),
        **extra,
    }
    return {"recording": "day.csv", "repair": repair}, builder


def adopted(folder: Path, data: Mapping[str, Any]) -> Path:
    """Write as the command does, and compile; the new plant."""
    file = folder / "mismatch.json"
    file.write_text(json.dumps(data), encoding="utf-8")
    repair = repair_of(read_form(file), file)
    builder = builder_of(plant_of(read_form(file), file))
    assert builder.sources is not None
    with put_in_place(folder / "new") as place:
        write_plant(place, builder.sources, adoption_of(builder, repair), repair)
    rules_of(folder / "new")
    return folder / "new"


@functools.lru_cache(maxsize=8)
def models_of(plant: Path) -> Compilation:
    """What the files of a plant say; they stay as they are."""
    return run_passes(Compilation(path=plant), "types")


@functools.lru_cache(maxsize=8)
def rules_of(plant: Path) -> Ruleset:
    """The ruleset of a plant whose files stay as they are."""
    return run_passes(models_of(plant)).ruleset


def values_of(data: Mapping[str, Any], builder: ModelBuilder) -> dict[str, float]:
    """All parameters as the analysis had them."""
    repair = data["repair"]
    values = dict(zip(repair["parameters"], repair["values"], strict=True))
    fixed = {k: v for entry in repair["joined"] for k, v in entry["fixed"].items()}
    return {**builder.parameters.constants, **values, **fixed}


def assert_same_flows(
    plant: Path, data: Mapping[str, Any], builder: ModelBuilder, module: str
) -> None:
    """The new plant, read from its files, gives what the analysis had: to 1e-12."""
    names = tuple(entry["id"] for entry in data["repair"]["joined"])
    random = np.random.default_rng(7)
    readings: dict[str, Array | float] = {
        name: value * (1.0 + 0.02 * random.standard_normal(20))
        for name, value in builder._readings.items()
    }
    expected = builder.plan(module, names).run({**readings, **values_of(data, builder)})
    network = models_of(plant).network
    read = parameter_values(network.plant)
    found = lower_module(Lowering(network, {}), module).run({**read, **readings})
    flows = [name for name in expected if name.startswith("q:")]
    assert flows
    for name in flows:
        # Values pass through a file in display units with 15 digits, some of them through
        # differences that nearly vanish.
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-12)


def test_one_effect_in_the_only_instance(tmp_path: Path) -> None:
    """Same type, next version, with the law, its parameters and where they come from; covariances
    of the plain parameters with the effect's stand in one block of the calibration. The new plant
    is checked like any other, and can be adopted into again."""
    found = [(f"main.{SLIP}@Q_law", {"b": 0.021, "T0": 318.0})]
    extra = {"misfit": {"main.pump": 2e-7}, "range": {"main.T": [308.15, 331.15]}}
    data, builder = mismatch(WITHOUT, found, **extra)
    repair = data["repair"]
    first, last = repair["parameters"].index("main.C1"), len(repair["parameters"]) - 1
    both = 0.05 * np.sqrt(repair["covariance"][first][first] * repair["covariance"][last][last])
    repair["covariance"][first][last] = repair["covariance"][last][first] = both
    new = adopted(tmp_path, data)
    kind = models_of(new).plant.modules["main"].type
    assert ("pump-set", 2) == (kind.name, kind.version)
    assert "Q0 - (Q0 - Q_law_plain)*exp(b*(T - T0))" == kind.definitions["Q_law"].expression.text
    assert "Q0 - C1*dp" == kind.definitions["Q_law_plain"].expression.text
    assert "fitted to day.csv" in kind.parameters["b"].origin.source
    assert not kind.parameters["T0"].fit
    module = models_of(new).plant.modules["main"]
    assert 0.0021 == pytest.approx(module.parameters["b"].u)
    assert 2e-7 == pytest.approx(module.misfit["pump"])
    assert (308.15, 331.15) == pytest.approx(module.valid["T"])
    (block,) = module.blocks
    factor = np.array(block.factor)
    i, j = block.parameters.index("C1"), block.parameters.index("b")
    np.testing.assert_allclose((factor @ factor.T)[i, j], both, rtol=1e-6)
    assert_same_flows(new, data, builder, "main")
    assert 0 == main(["check", str(new)])
    valve = next(c.id for c in builder_of(new).candidates if c.name == "relief-valve")
    again, _ = mismatch(new, [(valve, {"K": 1e-11, "p_open": 1.85e7})])
    (tmp_path / "second").mkdir()
    second = adopted(tmp_path / "second", again)
    assert 3 == models_of(second).plant.modules["main"].type.version


def test_instances_that_differ_get_types_of_their_own(tmp_path: Path) -> None:
    """Who stays as he was keeps the type; each other way is named after its first module. Instances
    amended alike share one, with values of their own in the calibration."""
    slip = [(f"{m}.{SLIP}@Q_geo", {"b": b, "T0": 293.0}) for m, b in (("A", 0.02), ("B", 0.03))]
    data, builder = mismatch(PLANTS / "mixing-rig", [*slip, ("B.line-laminar@plant", {"a": 1e-6})])
    new = adopted(tmp_path, data)
    modules = models_of(new).plant.modules
    names = {name: (modules[name].type.name, modules[name].type.version) for name in "ABC"}
    assert {"A": ("dosing-pcp-A", 2), "B": ("dosing-pcp-B", 2), "C": ("dosing-pcp", 1)} == names
    for module in ("A", "B", "C", "M1"):
        assert_same_flows(new, data, builder, module)
    (tmp_path / "alike").mkdir()
    data, _ = mismatch(PLANTS / "abc", slip)
    modules = models_of(adopted(tmp_path / "alike", data)).plant.modules
    assert modules["A"].type is modules["B"].type
    assert ("dosing-pcp", 2) == (modules["A"].type.name, modules["A"].type.version)
    assert [0.02, 0.03] == [modules[m].parameters["b"].value for m in "AB"]
    assert 0.02 == modules["B"].type.parameters["b"].value  # what both share is as A has it
    assert 293.0 == pytest.approx(modules["A"].reference["T"])


def test_a_reading_from_downstream_is_provided(tmp_path: Path) -> None:
    """A law driven by a signal of the module behind: it provides the name, the law gathers it."""
    flow = 0.9
    found = [(f"P{i}.shared-riser@head", {"h_s": 1.5, "Qs0": flow}) for i in (11, 12)]
    extra = {"range": {"channel.Q": [0.5, 1.3]}}
    data, builder = mismatch(PLANTS / "hsy-pumping", found, **extra)
    new = adopted(tmp_path, data)
    network = models_of(new).network
    kind = network.plant.modules["P11"].type
    assert "downstream(Q_channel)" in kind.definitions["head"].expression.text
    assert {"l_suction": "l", "Q_channel": "Q"} == network.plant.modules["channel"].type.provides
    assert (("channel", "Q"),) == network.gathers["P11", "Q_channel"]
    assert "grundfos-s3-145-P12" == network.plant.modules["P12"].type.name
    assert "grundfos-s3-145" == network.plant.modules["P13"].type.name
    for module in ("P11", "P12", "P13"):
        assert_same_flows(new, data, builder, module)


@pytest.mark.parametrize(
    ("name", "given", "reason"),
    [
        ("main.leakage", {"x": 0.1}, "a fault is to be mended"),
        ("main.offset-pressure@dp", {"z": 1e5}, "a sensor is to be mended"),
        ("main.wear-slip@Q_law", {"w": 1e-6}, "what changes with time"),
        ("main.warm-up-slip@Q_law", {"a": 0.1, "tau": 600.0}, "a module type knows no time"),
    ],
)
def test_what_is_no_physics_of_the_module_is_left_out(
    tmp_path: Path, name: str, given: Mapping[str, float], reason: str
) -> None:
    """It has a reason, and the type stays as it was."""
    data, _ = mismatch(WITHOUT, [(name, given)])
    module = models_of(adopted(tmp_path, data)).plant.modules["main"]
    assert reason in left_out(tmp_path)
    assert 1 == module.type.version
    index = data["repair"]["parameters"].index("main.C1")
    assert data["repair"]["values"][index] == pytest.approx(module.parameters["C1"].value)


def left_out(folder: Path) -> str:
    """Reasons for what was not taken over."""
    file = folder / "mismatch.json"
    data = read_form(file)
    adoption = adoption_of(builder_of(plant_of(data, file)), repair_of(data, file))
    return "; ".join(reason for _, reason in adoption.left)


def test_what_has_no_name_is_written_as_a_curve(tmp_path: Path) -> None:
    """Straight between its points, level beyond them, in a type of its own."""
    n, power = np.array([8.0, 12.0, 20.0]), np.array([-3.0, 5.0, 1.0])
    curve = CurveTerm(
        "definition:A.P_law", "A.n", tuple(zip(n.tolist(), power.tolist(), strict=True))
    )
    data, builder = mismatch(PLANTS / "abc", [], curves=[vars(curve)])
    fixed = {u.id: u.factor for u in builder.curve_term(curve).unknowns}
    data["repair"]["joined"] = [{"id": curve.id, "unknowns": {}, "fixed": fixed}]
    network = models_of(adopted(tmp_path, data)).network
    assert "dosing-pcp-A" == network.plant.modules["A"].type.name
    assert "dosing-pcp" == network.plant.modules["B"].type.name
    there = np.array([4.0, 8.0, 10.0, 14.0, 20.0, 30.0])
    readings = {**builder._readings, "A.n": there}
    found = lower_module(Lowering(network, {}), "A", definitions=True).run(
        {**parameter_values(network.plant), **readings}
    )
    added = found["d:P_law"] - found["d:P_law_plain"]
    np.testing.assert_allclose(added, np.interp(there, n, power), rtol=1e-3)


@pytest.mark.parametrize(
    ("location", "driver", "points", "expected"),
    [
        ("definition:A.gone", "A.n", [[1.0, 0.0], [2.0, 1.0]], "does not fit abc"),
        ("definition:A.P_law", "A.gone", [[1.0, 0.0], [2.0, 1.0]], "does not fit abc"),
        ("definition:A.P_law", "A.n", [[2.0, 0.0], [1.0, 1.0]], "do not go up"),
    ],
)
def test_a_curve_that_does_not_fit_is_refused(
    location: str, driver: str, points: list[list[float]], expected: str, tmp_path: Path
) -> None:
    curve = {"place": location, "driver": driver, "points": points}
    data, _ = mismatch(PLANTS / "abc", [], curves=[curve])
    with pytest.raises(AdoptRefused, match=expected):
        adopted(tmp_path, data)


def test_a_curve_has_as_many_points_as_an_equation_holds() -> None:
    """However long the name of its driver, and whatever its numbers."""
    builder = builder_of(PLANTS / "abc")
    at = np.linspace(-1.234567e-3, 7.654321e-3, 60)
    for driver in ("A.n", "A.dp"):
        curve = curve_through("definition:A.P_law", driver, at, 1e-5 * np.sin(2e3 * at))
        assert 6 < len(curve.points) < 20
        builder.curve_term(curve)


ODD: tuple[Any, ...] = (
    "yes", "no", "~", "", " x", "a: b", "a #b", "- a", "1e-3", "0x1", "[a]", "{a}", "a, b", "'",
    '"', "a\nb", "100 %", "1.5", 1.5, 1e-30, 3, True, None, ["a, b", 1], {"k": "v: w"}, "µ·²",
)  # fmt: skip


def test_what_is_written_is_read_back() -> None:
    """Every shipped module type, and texts that mean something to YAML: by our reader, and by
    YAML's own."""
    for file in sorted((ROOT / "kb" / "modules").glob("*.yaml")):
        document, _ = read_document(file)
        assert document is not None
        again, mistakes = parse_document("again.yaml", "\n".join(lines(document.data)))
        assert again is not None
        assert ([], document.data) == (mistakes, again.data), file
    for value in ODD:
        text = f"key: {flow(value)}"
        document, mistakes = parse_document("x.yaml", text)
        assert document is not None
        assert ([], {"key": value}) == (mistakes, document.data)
        assert {"key": value} == yaml.safe_load(text) or isinstance(value, float)
