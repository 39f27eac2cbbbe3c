"""Compiled plants are kept, in a private folder, as long as their sources stay what they are."""

import os
import shutil
import threading
from pathlib import Path

import pytest
from rulec_runtime import limits
from rulec_runtime.output import private_folder
from rulec_runtime.output.private_folder import cached, keep

from rulec.language.diagnostics import Refused
from rulec.passes import compile_cache, pipeline
from rulec.passes.compile_cache import ruleset_of_plant
from tests.conftest import ROOT, compiled
from tests.test_imports import HEAVY, loaded

COMPILE = pipeline.compile_plant
RECORDING = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
UNIX = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have no owners here")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where things are kept in this test."""
    monkeypatch.setenv("RULEC_CACHE", str(tmp_path / "cache"))
    private_folder._say.cache_clear()
    return tmp_path / "cache" / "plants"


@pytest.fixture
def plant(tmp_path: Path, folder: Path) -> Path:
    return Path(shutil.copytree(ROOT / "plants" / "abc", tmp_path / "abc"))


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Plants that were compiled, which costs nothing here."""
    found: list[Path] = []
    monkeypatch.setattr(
        pipeline, "compile_plant", lambda path: (found.append(path), compiled("abc"))[1]
    )
    return found


def test_second_start_loads_no_compiler(plant: Path, tmp_path: Path) -> None:
    """The same output, without sympy, yaml and the rest; a check keeps what it has read."""
    made = [tmp_path / name for name in ("first.json", "second.json")]
    assert loaded("compile", str(plant), "-o", str(made[0])) >= {"sympy"}
    assert not loaded("compile", str(plant), "-o", str(made[1])) & HEAVY
    assert made[0].read_bytes() == made[1].read_bytes()
    assert not loaded("diagnose", str(plant / "plant.yaml"), str(RECORDING)) & HEAVY
    assert not loaded("export", str(plant), "--to", "c", "-o", str(tmp_path / "code")) & HEAVY
    for _ in range(2):
        packages = loaded("check", str(plant), str(RECORDING))
    assert not packages & HEAVY


def _longer(plant: Path, name: str = "plant.yaml") -> None:
    file = plant / name
    file.write_text(file.read_text() + "# another byte\n")


def test_changed_source_is_compiled(
    plant: Path, folder: Path, compilations: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a plant, of knowledge beside it and of named files anywhere; and with other knowledge or
    other code. Not where a file changed that no ruleset depends on, unless nothing is kept."""
    file, columns = plant / "plant.yaml", plant.parent / "columns.yaml"
    file.write_text(file.read_text() + "columns: ../columns.yaml\n")
    columns.write_text("columns: x\n")

    def compiled_anew() -> bool:
        before = len(compilations)
        for given in (plant, plant, plant / "plant.yaml"):
            assert ruleset_of_plant(given) == compiled("abc")
        return len(compilations) == before + 1

    assert compiled_anew()
    _longer(plant, "limits.yaml")
    assert not compiled_anew()
    _longer(plant)
    assert compiled_anew()
    (plant / "kb").mkdir()
    shutil.copy(ROOT / "kb" / "sensors" / "piezoresistive.yaml", plant / "kb" / "another.yaml")
    assert compiled_anew()
    columns.write_text("columns: y\n")
    assert compiled_anew()
    monkeypatch.setenv("RULEC_KB", str(ROOT / "kb"))
    assert compiled_anew()
    monkeypatch.setattr(compile_cache, "_tool", lambda: "another")
    assert compiled_anew()
    shutil.rmtree(folder)
    monkeypatch.setenv("RULEC_CACHE", "off")
    ruleset_of_plant(plant)
    assert not folder.exists()
    monkeypatch.setenv("RULEC_CACHE", str(folder.parent))
    (plant / "plant.yaml").write_text("plant: abc\n")
    monkeypatch.setattr(pipeline, "compile_plant", COMPILE)
    for _ in range(2):
        with pytest.raises(Refused):
            ruleset_of_plant(plant)


def test_source_that_changes_meanwhile_is_not_kept(
    plant: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipeline, "compile_plant", lambda p: (_longer(plant), compiled("abc"))[1])
    ruleset_of_plant(plant)
    assert not folder.exists()


def test_damaged_file_is_ignored_and_written_anew(
    plant: Path, folder: Path, compilations: list[Path]
) -> None:
    """Cut, changed or foreign; nor does a file under another name count."""
    ruleset_of_plant(plant)
    (file,) = folder.glob("*.ruleset")
    whole = file.read_bytes()
    damage = (b"", b"rulec kept 1", b"\x80\x04N.", b"x" * 1000, whole[:-1])
    for bad in (*damage, whole.replace(b"leakage", b"leakagf", 1)):
        file.write_bytes(bad)
        assert ruleset_of_plant(plant) == compiled("abc")
        assert file.read_bytes() == whole
    assert len(compilations) == 7
    keep("one", b"data")
    shutil.copy(folder / "one", folder / "two")
    assert (cached("one"), cached("two")) == (b"data", None)


@UNIX
def test_folder_is_the_users_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What others may write does not count, nor, where that can be tried, what others own."""
    keep("one", b"data")
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (folder / "one").stat().st_mode & 0o777 == 0o600
    folder.chmod(0o770)
    keep("two", b"data")
    assert (cached("one"), cached("two")) == (None, None)
    assert "others may read or write it" in capsys.readouterr().err
    folder.chmod(0o700)
    if os.geteuid() == 0:
        os.chown(folder, 12345, 12345)
        assert cached("one") is None


@UNIX
def test_links_are_not_followed(folder: Path, tmp_path: Path) -> None:
    keep("one", b"data")
    real = folder.rename(tmp_path / "real")
    folder.symlink_to(real)
    assert cached("one") is None
    keep("two", b"data")
    assert [real / "one"] == list(real.iterdir())


def test_oldest_go_first(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_CACHED_BYTES", 1000)
    for i, name in enumerate("abc"):
        keep(name, bytes(200))
        os.utime(folder / name, (i, i))
    assert cached("a")  # so it is the youngest now
    keep("d", bytes(200))
    assert {"a", "c", "d"} == {f.name for f in folder.iterdir()}
    keep("e", bytes(600))  # more than half of all
    assert cached("e") is None


def test_many_at_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who reads sees a whole file or none, also where others remove."""
    monkeypatch.setattr(limits, "MOST_CACHED_BYTES", 50_000)
    bodies = {name: name.encode() * 10_000 for name in "abcdefgh"}
    seen: list[bool] = []

    def work(name: str) -> None:
        for _ in range(30):
            keep(name, bodies[name])
            seen.extend(cached(n) in (None, bodies[n]) for n in "abcdefgh")

    threads = [threading.Thread(target=work, args=(name,)) for name in "abcdefgh"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(seen) == 8 * 30 * 8
    assert all(seen)
    assert sum(f.stat().st_size for f in folder.iterdir()) <= 60_000
