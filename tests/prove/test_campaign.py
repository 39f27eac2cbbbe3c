"""A run of the proof as a user starts it: sealed, resumed after a kill, told."""

import json
from pathlib import Path

import pytest

from rulec.cli import main as rulec
from rulec.engines.call import Engine
from rulec.prove import campaign
from rulec.prove.analyst import FORM, analyse
from rulec.prove.campaign import Campaign, Changed, Workers, digest_of
from rulec.prove.partition import Partition, register

FEW = Partition("development", 1, quick=True, only="stationary-1-clean--1")
"""A few clean cases."""


def few(folder: Path, seed: int = 1) -> Campaign:
    """Of a run of which nobody watches the progress."""
    partition = Partition("development", seed, quick=True, only=FEW.only)
    return Campaign(partition, folder, Workers(Engine(jobs=1), lambda *_: None))


@pytest.mark.usefixtures("in_this_process")
def test_a_run_goes_on_where_it_was(tmp_path: Path) -> None:
    """What is sealed and answered stays; another run is refused, and an answer whose hash is not
    the one that was told beforehand."""
    seals = few(tmp_path).sealed()
    folders = sorted((tmp_path / "cases").iterdir())
    assert len(folders) == len(seals) >= 5
    for folder in folders[1:]:
        (folder / FORM).write_text(json.dumps({"verdict": "none", "seconds": 1.0}))
    before = (tmp_path / campaign.SEALS).read_bytes()
    assert few(tmp_path).sealed() == seals
    few(tmp_path).analysed(seals)
    found = few(tmp_path).judged(seals)
    assert [1.0] * len(seals) == [j.clean_right for j in found]
    assert before == (tmp_path / campaign.SEALS).read_bytes()
    with pytest.raises(Changed, match="another run"):
        few(tmp_path, seed=2).sealed()
    others = ["0" * 64, *seals[1:]]
    assert digest_of(seals) != digest_of(others)
    with pytest.raises(Changed, match="not the one that was sealed"):
        few(tmp_path).judged(others)


def test_a_run_does_not_go_on_as_another_or_with_another_tool(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the sealing was interrupted; what two tools answered is no run of either."""
    assert [] == campaign.owned(tmp_path, "a run") == campaign.owned(tmp_path, "a run")
    with pytest.raises(Changed, match="another run"):
        campaign.owned(tmp_path, "two")
    monkeypatch.setattr(campaign, "tool_digest", lambda: "another")
    with pytest.raises(Changed, match="changed since"):
        campaign.owned(tmp_path, "a run")


def test_what_the_tool_refuses_is_an_answer(tmp_path: Path) -> None:
    """With its message, and kept like any other."""
    (tmp_path / "plant").mkdir()
    (tmp_path / "plant" / "plant.yaml").write_text("plant: [")
    (tmp_path / "recording.csv").write_text("time [s]\n0\n")
    first = analyse(tmp_path)
    assert "KB" in first["error"]
    assert first == analyse(tmp_path)


def test_the_final_partition_is_drawn_once() -> None:
    """Its seed is in the register, with how often it was opened."""
    final = register()["final"]
    assert final["opened"] == len(final["log"])
    assert (final["seed"] is None) == (final["opened"] == 0)
    assert final["seed"] != register()["development"]["seed"]


@pytest.mark.parametrize(
    ("only", "cases", "clean_ones"),
    [("clean--13", 1, 1), pytest.param("", 39, 20, marks=pytest.mark.prove)],
)
def test_a_quick_run_in_its_own_processes(
    only: str, cases: int, clean_ones: int, tmp_path: Path
) -> None:
    """As a user starts it. They guard what works and prove nothing: no case fails, no clean one is
    accused, and most that can be seen are named."""
    json_, page = tmp_path / "run.json", tmp_path / "run.html"
    asked = ["--quick", "--only", only, "--json", str(json_), "--report", str(page)]
    assert rulec(["prove", *asked]) == 0
    found = json.loads(json_.read_text(encoding="utf-8"))["judged"]
    assert cases == len(found)
    assert [] == [(j["case"], j["error"]) for j in found if j["error"]]
    clean = [j for j in found if not j["planted"]]
    assert len(clean) >= clean_ones
    assert [] == [j["case"] for j in clean if j["verdict"] != "none"]
    sure = [j for j in found if j["name_right"] is not None and float(j["gain"]) > 300]
    assert sum(j["name_right"] for j in sure) >= 0.6 * len(sure)
    assert "<h1" in page.read_text(encoding="utf-8")
