"""Skeletons and schemas."""

import json
import re
from pathlib import Path

import pytest

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.language.read_yaml import read_document
from rulec.language.schema import KINDS, kind_of
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT
from tests.layers.conftest import PLANT, write

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
    for words, told in ((["plant", "x"], "next: rulec check x"), (["module", "y"], "y.yaml")):
        assert main(["init", *words]) == 0
        assert told in capsys.readouterr().out


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
