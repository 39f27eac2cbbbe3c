"""Compiled plants are kept, in a private folder, as long as their sources stay what they are."""

from __future__ import annotations

import os
import re
import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from rulec_runtime import limits
from rulec_runtime.output import private_folder
from rulec_runtime.output.private_folder import keep, kept

from rulec.knowledge import fingerprint
from rulec.knowledge.read import read_plant
from rulec.language.diagnostics import Refused
from rulec.passes import pipeline
from rulec.passes.compile_cache import kept_of_plant, ruleset_of_plant
from rulec.passes.deferred_compilation import open_plant, sources_of_plant
from tests.conftest import ROOT, compiled
from tests.test_imports import HEAVY, loaded

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
    """The same output, without sympy, yaml and the rest."""
    made = [tmp_path / name for name in ("first.json", "second.json")]
    assert loaded("compile", str(plant), "-o", str(made[0])) >= {"sympy"}
    assert not loaded("compile", str(plant), "-o", str(made[1])) & HEAVY
    assert made[0].read_bytes() == made[1].read_bytes()
    assert not loaded("matrix", str(plant)) & HEAVY
    assert not loaded("diagnose", str(plant / "plant.yaml"), str(RECORDING)) & HEAVY
    assert not loaded("simulate", str(plant), str(RECORDING), "-o", str(tmp_path / "s.csv")) & HEAVY
    assert not loaded("export", str(plant), "--to", "c", "-o", str(tmp_path / "code")) & HEAVY
    recording = ("check", str(plant), str(RECORDING))
    for asked in (recording, ("check", str(plant)), ("show", "order", str(plant))):
        loaded(*asked)
        assert not loaded(*asked) & HEAVY


def test_what_is_kept_is_the_ruleset(plant: Path) -> None:
    first = ruleset_of_plant(plant)
    second = ruleset_of_plant(plant)
    assert first is not second
    assert (first.to_json(), first) == (second.to_json(), second)


def _longer(plant: Path, name: str = "plant.yaml") -> None:
    file = plant / name
    file.write_text(file.read_text() + "# another byte\n")


def _own_knowledge(plant: Path) -> None:
    (plant / "kb").mkdir()
    fault = (ROOT / "kb" / "sensors").glob("*.yaml")
    shutil.copy(next(fault), plant / "kb" / "another.yaml")


CHANGES: dict[str, tuple[Callable[[Path], None], bool]] = {
    "plant file": (_longer, True),
    "knowledge beside it": (_own_knowledge, True),
    "file that no ruleset depends on": (lambda plant: _longer(plant, "limits.yaml"), False),
}


@pytest.mark.parametrize("what", CHANGES)
def test_changed_source_is_compiled(what: str, plant: Path, compilations: list[Path]) -> None:
    change, matters = CHANGES[what]
    ruleset_of_plant(plant)
    ruleset_of_plant(plant / "plant.yaml")
    assert len(compilations) == 1
    change(plant)
    ruleset_of_plant(plant)
    assert len(compilations) == 1 + matters


def test_named_files_count(plant: Path, compilations: list[Path]) -> None:
    """Column maps, calibrations and named knowledge lie anywhere."""
    file, columns = plant / "plant.yaml", plant.parent / "columns.yaml"
    file.write_text(file.read_text() + "columns: ../columns.yaml\n")
    columns.write_text("columns: x\n")
    for text in ("columns: x\n", "columns: x\n", "columns: y\n"):
        columns.write_text(text)
        ruleset_of_plant(plant)
    assert len(compilations) == 2


def test_variable_and_tool_count(
    plant: Path, compilations: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other knowledge, other code or other libraries: another ruleset."""
    ruleset_of_plant(plant)
    monkeypatch.setenv("RULEC_KB", str(ROOT / "kb"))
    ruleset_of_plant(plant)
    assert len(compilations) == 2
    monkeypatch.setattr(fingerprint, "_tool", lambda: "another")
    ruleset_of_plant(plant)
    assert len(compilations) == 3


def test_source_that_changes_meanwhile_is_not_kept(
    plant: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipeline, "compile_plant", lambda p: (_longer(plant), compiled("abc"))[1])
    ruleset_of_plant(plant)
    assert not folder.exists()


def test_mistakes_are_told_each_time(plant: Path) -> None:
    (plant / "plant.yaml").write_text("plant: abc\n")
    for _ in range(2):
        with pytest.raises(Refused):
            ruleset_of_plant(plant)


def test_none_is_made_anew(plant: Path) -> None:
    made = iter((None, [1.5], [2.5]))
    assert [kept_of_plant(plant, "x", lambda: next(made)) for _ in range(3)] == [None, [1.5], [1.5]]


@pytest.mark.parametrize("effects", [False, True])
@pytest.mark.parametrize("name", ["abc", "dosing-line", "mixing-rig"])
def test_kept_documents_are_those_read(name: str, effects: bool, folder: Path) -> None:
    """To the last digit and place, whether the plant is named as a folder or as a file."""
    plant = ROOT / "plants" / name
    fresh = read_plant(plant, effects)
    for given in (plant, plant, plant / "plant.yaml"):
        assert repr(sources_of_plant(given, effects)) == repr(fresh)
        assert vars(sources_of_plant(given, effects).plant) == vars(fresh.plant)
    found = sources_of_plant(plant, effects)
    places = [(d.values, d.keys) for part in found.by_kind.values() for d in part]
    assert places == [(d.values, d.keys) for part in fresh.by_kind.values() for d in part]
    assert found.digest() == fresh.digest()


def test_kept_documents_are_named_from_where_the_tool_runs(
    plant: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Messages name files as seen from the working folder, which may be another one now."""
    sources_of_plant(plant)
    monkeypatch.chdir(plant)
    again = sources_of_plant(Path())
    assert again.plant is not None
    assert again.plant.path == again.plant.place("modules").file == "plant.yaml"
    assert repr(again) == repr(read_plant(Path()))


@pytest.mark.parametrize("what", ["changed", "damaged", "gone"])
def test_documents_are_read_again(what: str, plant: Path, folder: Path) -> None:
    """Where a source changed, or what is kept is not what was written."""
    first = sources_of_plant(plant)
    (file,) = folder.glob("*.sources")
    if what == "changed":
        text = (plant / "plant.yaml").read_text()
        (plant / "plant.yaml").write_text(f"# a line more\n{text}")
    elif what == "damaged":
        file.write_bytes(file.read_bytes().replace(b"abc", b"abd", 1))
    else:
        file.unlink()
    again = sources_of_plant(plant)
    assert repr(again) == repr(read_plant(plant))
    assert first.plant is not None
    assert again.plant is not None
    line = first.plant.place("modules").line + (what == "changed")
    assert again.plant.place("modules").line == line


def test_models_of_an_opened_plant(plant: Path) -> None:
    """The same from what is kept, where the passes behind the types are not run again."""
    first = open_plant(plant).models
    second = open_plant(plant).models
    assert first.assembly is not None
    assert second.assembly is None
    for part in ("types", "plant"):
        texts = [repr(getattr(models, part)) for models in (first, second)]
        assert len({re.sub("at 0x[0-9a-f]+", "", text) for text in texts}) == 1
    assert second.ruleset == first.ruleset


def test_commands_that_model_read_first(plant: Path, tmp_path: Path) -> None:
    """A second start reads plant and recording before it loads a compiler."""
    bad = tmp_path / "bad.csv"
    bad.write_text("time,nothing\n0,1\n")
    for command in (("calibrate", "-o", str(tmp_path / "c.yaml")), ("mismatch",)):
        given = (*command, str(plant), str(bad))
        assert "jsonschema" in loaded(*given, code=1)
        assert not loaded(*given, code=1) & (HEAVY - {"yaml"})


@pytest.mark.parametrize("damage", [b"", b"rulec kept 1", b"\x80\x04N.", b"x" * 1000])
def test_damaged_file_is_ignored_and_written_anew(
    damage: bytes, plant: Path, folder: Path, compilations: list[Path]
) -> None:
    ruleset_of_plant(plant)
    (file,) = folder.glob("*.ruleset")
    whole = file.read_bytes()
    for bad in (damage, whole[:-1], whole.replace(b"leakage", b"leakagf", 1)):
        file.write_bytes(bad)
        assert ruleset_of_plant(plant) == compiled("abc")
        assert file.read_bytes() == whole
    assert len(compilations) == 4


def test_file_under_another_name_does_not_count(folder: Path) -> None:
    keep("one", b"data")
    shutil.copy(folder / "one", folder / "two")
    assert (kept("one"), kept("two")) == (b"data", None)


@UNIX
def test_folder_is_the_users_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keep("one", b"data")
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (folder / "one").stat().st_mode & 0o777 == 0o600
    folder.chmod(0o770)
    keep("two", b"data")
    assert (kept("one"), kept("two")) == (None, None)
    assert "others may read or write it" in capsys.readouterr().err
    folder.chmod(0o700)
    (folder / "one").chmod(0o622)
    assert kept("one") is None


@UNIX
def test_links_are_not_followed(folder: Path, tmp_path: Path) -> None:
    keep("one", b"data")
    real = folder.rename(tmp_path / "real")
    folder.symlink_to(real)
    assert kept("one") is None
    keep("two", b"data")
    assert [real / "one"] == list(real.iterdir())
    folder.unlink()
    real.rename(folder)
    (folder / "one").rename(tmp_path / "one")
    (folder / "one").symlink_to(tmp_path / "one")
    assert kept("one") is None
    keep("one", b"new")
    assert (kept("one"), (folder / "one").is_symlink()) == (b"new", False)
    assert b"data" in (tmp_path / "one").read_bytes()


@UNIX
def test_files_of_others_do_not_count(folder: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can give files away")
    keep("one", b"data")
    os.chown(folder / "one", 12345, 12345)
    assert kept("one") is None
    keep("one", b"data")
    os.chown(folder, 12345, 12345)
    assert kept("one") is None


def test_folder_that_cannot_be_written_is_said_once(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder.parent.write_text("a file")
    for name in ("one", "two"):
        keep(name, b"data")
        assert kept(name) is None
    told = capsys.readouterr().err
    assert told.count("compiled anew") == 1
    assert "RULEC_CACHE" in told


def test_nothing_is_kept_where_it_is_off(
    plant: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, compilations: list[Path]
) -> None:
    monkeypatch.setenv("RULEC_CACHE", "off")
    for _ in range(2):
        ruleset_of_plant(plant)
    assert (len(compilations), folder.exists()) == (2, False)


def test_oldest_go_first(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_KEPT_BYTES", 1000)
    for i, name in enumerate("abc"):
        keep(name, bytes(200))
        os.utime(folder / name, (i, i))
    assert kept("a")  # so it is the youngest now
    keep("d", bytes(200))
    assert {"a", "c", "d"} == {f.name for f in folder.iterdir()}
    keep("e", bytes(600))  # more than half of all
    assert kept("e") is None


def test_many_at_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who reads sees a whole file or none, also where others remove."""
    monkeypatch.setattr(limits, "MOST_KEPT_BYTES", 50_000)
    bodies = {name: name.encode() * 10_000 for name in "abcdefgh"}
    seen: list[bool] = []

    def work(name: str) -> None:
        for _ in range(30):
            keep(name, bodies[name])
            seen.extend(kept(n) in (None, bodies[n]) for n in "abcdefgh")

    threads = [threading.Thread(target=work, args=(name,)) for name in "abcdefgh"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(seen) == 8 * 30 * 8
    assert all(seen)
    assert sum(f.stat().st_size for f in folder.iterdir()) <= 60_000
