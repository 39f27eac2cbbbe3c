"""Knowledge of one's own beside the shipped one."""

import importlib
import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from rulec_runtime.contract.ruleset_file import read_ruleset

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.effects.adopt import Adoption
from rulec.effects.write_plant import knowledge_files
from rulec.knowledge.read import read_plant
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.language.read_yaml import read_document
from rulec.language.schema import KINDS, kind_of
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, compiled

VALVE = """\
module: acme-valve
version: 3
title: Control valve with a flow meter
signals:
  dp:
    {quantity: pressure difference, unit: inWC, sensor: piezoresistive, range: [0, 400]}
  Q:  {quantity: volume flow, unit: m3/h, sensor: magnetic-inductive, reference: 2}
parameters:
  Kv: {value: 0.5, unit: m3/h/kPa**0.5, u: 0.01, source: data sheet}
observers:
  valve: {component: valve, Q: Kv*sqrt(dp), accuracy: "10 %, IEC 60534-2-4", source: IEC 60534-2-1}
  flow:  {component: line, Q: Q, reference: true, source: flow meter}
faults: [slope(Q)]
"""
UNITS = """\
units:
  inWC: {factor: 249.08891, dimension: {kg: 1, m: -1, s: -2}, note: inch of water}
"""
PLANT = """\
plant: p
title: one valve
modules:
  A: {type: acme-valve}
"""


def write(folder: Path, **files: str) -> Path:
    """Write files into a folder: `a__b` is `a/b.yaml`; returns the folder."""
    for name, text in files.items():
        file = folder / f"{name.replace('__', '/')}.yaml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def plant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A plant of a type that nobody has described yet, in the working folder."""
    monkeypatch.delenv("RULEC_KB", raising=False)
    monkeypatch.chdir(tmp_path)
    return write(Path("p"), plant=PLANT)


Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Put a package beside the installed ones, as pip would; its code must not be run."""
    site = tmp_path / "site-packages"

    def installed(name: str = "acme-pumps-kb", entry: str = "acme_pumps_kb", **files: str) -> Path:
        package = write(site / name.replace("-", "_"), **files)
        (package / "__init__.py").write_text("raise RuntimeError('imported')", encoding="utf-8")
        info = site / f"{package.name}-1.2.dist-info"
        info.mkdir()
        info.joinpath("METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        info.joinpath("entry_points.txt").write_text(f"[rulec.kb]\nkb = {entry}\n")
        monkeypatch.syspath_prepend(str(site))
        importlib.invalidate_caches()
        return package

    return installed


def refused(plant: Path) -> list[Diagnostic]:
    with pytest.raises(Refused) as mistakes:
        compile_plant(plant)
    return list(mistakes.value.diagnostics)


def test_folders_count(plant: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A type, a unit and a root in a unit of one's own, beside all shipped ones: below the plant
    without being named, as links too; named by the plant; named by the variable."""
    write(plant / "kb", units=UNITS)
    write(Path("elsewhere"), valve=VALVE)
    (plant / "kb" / "acme.yaml").symlink_to(Path("elsewhere/valve.yaml").resolve())
    assert collect([plant]) == []
    ruleset = compile_plant(plant)
    flow = 0.5 / 3600 * (ruleset.signal_by_id["A.dp"].reference / 1000) ** 0.5
    assert ruleset.observer_by_id["A.valve"].reference == pytest.approx(flow, rel=1e-6)
    assert ("p/kb", "") == (ruleset.knowledge[0].name, ruleset.knowledge[0].version)
    assert "p/kb/acme.yaml:9" in ruleset.parameters[0].origin
    shutil.move(plant / "kb", "maker")
    for listed in ("../maker", "[../maker]"):
        write(plant, plant=f"{PLANT}kb: {listed}\n")
        assert collect([plant]) == []
        assert compile_plant(plant).knowledge[0].name.endswith("/maker")
    write(plant, plant=PLANT)
    monkeypatch.setenv("RULEC_KB", f"maker{os.pathsep}elsewhere")
    Path("maker/acme.yaml").unlink()
    assert len(compile_plant(plant).knowledge) == 3
    monkeypatch.setenv("RULEC_KB", f"maker{os.pathsep}third")
    assert [("KB001", "RULEC_KB")] == [(d.code, d.place.file) for d in refused(plant)]


def test_installed_packages_count(plant: Path, install: Install, tmp_path: Path) -> None:
    """With their versions, and with no code of them run; so they stand in the file. The plant names
    a type, the type a unit of another package; the hash follows what is taken."""
    package = install(modules__acme_valve=VALVE)
    install("inch-kb", "inch_kb", units=UNITS)
    assert collect([plant]) == []
    ruleset = compile_plant(plant)
    assert ("acme-pumps-kb", "1.2") == (ruleset.knowledge[0].name, ruleset.knowledge[0].version)
    assert {"acme-pumps-kb", "inch-kb"} < {k.name for k in ruleset.knowledge}
    assert "acme-pumps-kb/modules/acme_valve.yaml" in ruleset.parameters[0].origin
    (tmp_path / "p.json").write_text(ruleset.to_json(), encoding="utf-8")
    assert read_ruleset(tmp_path / "p.json") == ruleset
    write(package, modules__acme_valve=VALVE.replace("0.5, unit", "0.6, unit"))
    after = compile_plant(plant)
    changed = [a.name for a, b in zip(ruleset.knowledge, after.knowledge, strict=True) if a != b]
    assert changed == ["acme-pumps-kb"]
    assert ruleset.sources != after.sources


def test_package_that_a_plant_does_not_name_changes_nothing(install: Install) -> None:
    """Not even where it holds mistakes."""
    install(units=UNITS, modules__acme_valve=VALVE)
    install("bad-kb", "bad_kb", module="module: [")
    assert compile_plant(ROOT / "plants" / "abc") == compiled("abc")


@pytest.mark.parametrize("entry", ["gone_kb", "acme_pumps_kb.deeper", "..", ""])
def test_package_without_knowledge_is_told(plant: Path, install: Install, entry: str) -> None:
    install(entry=entry, units=UNITS)
    assert [("KB001", "acme-pumps-kb")] == [(d.code, d.place.file) for d in refused(plant)]


def test_adopted_plant_takes_its_layers_along(plant: Path, install: Install) -> None:
    """In folders of their own; the copy stands alone, beside the package and without it, and gives
    the same."""
    install(units=UNITS, modules__acme_pump=VALVE.replace("acme-valve", "acme-pump"))
    write(plant / "kb", modules__acme_valve=VALVE)
    before = compile_plant(plant)
    nothing = cast(Adoption, SimpleNamespace(changed={}, taken=()))
    for name, text in knowledge_files(read_plant(plant), nothing):
        file = Path("copy") / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    shutil.copy(plant / "plant.yaml", "copy")
    assert collect([Path("copy")]) == []
    shutil.rmtree("site-packages")
    assert collect([Path("copy")]) == []
    after = compile_plant(Path("copy"))
    assert (after.plan, after.cells) == (before.plan, before.cells)
    assert after.knowledge == ()


SCHEMAS = sorted((ROOT / "kb" / "schema").glob("*.json"))
LINE = re.compile(r"# yaml-language-server: \$schema=(\S+)\n")


@pytest.fixture(autouse=True)
def _away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RULEC_KB", raising=False)
    monkeypatch.chdir(tmp_path)


def leads_to_its_schema(file: Path) -> bool:
    document, _ = read_document(file)
    assert document is not None
    found = LINE.match(file.read_text(encoding="utf-8"))
    return found is not None and (
        json.loads((file.parent / found[1]).read_text(encoding="utf-8"))["$id"]
        == f"urn:rulec:schema:{kind_of(document)}"
    )


@pytest.mark.parametrize("kind", ["plant", "module", "fault", "effect", "kb"])
def test_skeleton_passes_the_check(kind: str) -> None:
    """As it is, without a warning of any kind; an editor finds its schema."""
    assert main(["init", kind, "acme-thing", "new"]) == 0
    assert collect([Path("new")]) == []
    files = list(Path("new").rglob("*.yaml"))
    assert files
    assert all(leads_to_its_schema(file) for file in files)
    assert not any("NAME" in f.read_text() or "PACKAGE" in f.read_text() for f in files)


def test_the_next_step_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    for words, expected in ((["plant", "x"], "next: rulec check x"), (["module", "y"], "y.yaml")):
        assert main(["init", *words]) == 0
        assert expected in capsys.readouterr().out


def test_a_plant_begins_like_a_shipped_one() -> None:
    """Its file under the own name, which stands alone."""
    assert main(["init", "plant", "mine", "--like", "cooling-loop"]) == 0
    assert collect([Path("mine")]) == []
    assert leads_to_its_schema(Path("mine/plant.yaml"))
    assert compile_plant(Path("mine")).plant == "mine"


def test_nothing_is_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    """And a name that no file could use is refused."""
    write(Path("new"), plant="mine\n")
    assert main(["init", "plant", "p", "new"]) == 1
    assert "new/plant.yaml' already exists" in capsys.readouterr().err
    assert ["new/plant.yaml"] == [str(f) for f in Path("new").rglob("*")]
    assert Path("new/plant.yaml").read_text() == "mine\n"
    for name in ("../x", "a b", "", "1", "x" * 99, "ü"):
        assert main(["init", "module", name, "fresh"]) == 1
        assert not Path("fresh").exists()


def test_schemas_and_lines_are_written_anywhere() -> None:
    """A line comes in where there is none or it leads nowhere; the rest of a file stays."""
    text = PLANT.replace("\n", "\r\n")
    dead = "# mine\n# yaml-language-server: $schema=../gone.json\nunits: {}\n"
    foreign = "# yaml-language-server: $schema=https://x.org/y.json\nunits: {}\n"
    write(Path("p"), plant="", kb__units=dead, kb__other=foreign, kb__stranger="a: 1\n")
    Path("p/plant.yaml").write_bytes(text.encode())
    assert main(["schema", "p"]) == 0
    head = b"# yaml-language-server: $schema=schema/plant.schema.json\r\n"
    assert head + text.encode() == Path("p/plant.yaml").read_bytes()
    units = "# mine\n# yaml-language-server: $schema=../schema/units.schema.json\nunits: {}\n"
    assert Path("p/kb/units.yaml").read_text() == units
    assert Path("p/kb/other.yaml").read_text() == foreign
    assert Path("p/kb/stranger.yaml").read_text() == "a: 1\n"
    names = {f"{kind}.schema.json": f"urn:rulec:schema:{kind}" for kind in KINDS}
    assert names == {f.name: json.loads(f.read_text(encoding="utf-8"))["$id"] for f in SCHEMAS}
    assert [f.name for f in SCHEMAS] == sorted(f.name for f in Path("p/schema").iterdir())
    before = {f: f.read_bytes() for f in Path("p").rglob("*.yaml")}
    assert main(["schema", "p"]) == 0
    assert before == {f: f.read_bytes() for f in before}
