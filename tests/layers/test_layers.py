"""Knowledge of one's own beside the shipped one."""

import os
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from rulec_runtime.contract.ruleset_file import read_ruleset

from rulec.commands.check_files import collect
from rulec.effects.adopt import Adoption
from rulec.effects.write_plant import knowledge_files
from rulec.knowledge.read import read_plant
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, compiled
from tests.layers.conftest import PLANT, UNITS, VALVE, Install, write


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
