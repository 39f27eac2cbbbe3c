"""The ZeMA rig: commissioning on some blocks, diagnosis of the others, against the labels."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import recordings_folder
from tests.rig.zema import Score, run


@pytest.fixture(scope="module")
def warm() -> Score:
    """Score of the pump law with oil temperature over unseen blocks."""
    return _score("with temperature")


@pytest.fixture(scope="module")
def cold() -> Score:
    """Score of the pump law that knows only pressure."""
    return _score("without temperature")


def _score(law: str) -> Score:
    folder = recordings_folder() / "zema-hydraulic"
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder} (set RULEC_RECORDINGS)")
    return run(folder, law)


def _sum(table: dict[str, int], word: str, without: str = "-") -> int:
    return sum(n for key, n in table.items() if key.startswith(word) and without not in key)


def test_no_healthy_cycle_alarms(warm: Score) -> None:
    """Not one of the 907 leak-free cycles of unseen blocks raises an alarm."""
    assert 907 == _sum(warm.cycles, "none")
    assert 0 == _sum(warm.alarmed, "none")


def test_severe_leakage_is_found_in_every_cycle(warm: Score) -> None:
    """Every cycle with severe leakage is found, with leakage among the causes."""
    assert _sum(warm.cycles, "severe") == _sum(warm.leak_named, "severe")


def test_weak_leakage_is_found(warm: Score) -> None:
    """Weak leakage (3 % of the flow) is found in at least 99 % of the cycles."""
    assert _sum(warm.leak_named, "weak") >= 0.99 * _sum(warm.cycles, "weak")


def test_degree_orders_the_labels(warm: Score) -> None:
    """The estimated degree orders none < weak < severe, without overlap in settled cycles."""
    weak, severe = warm.degree_range["weak, settled"], warm.degree_range["severe, settled"]
    assert 0.0 == warm.degree["none, settled"]
    assert 0.0 < weak[0] <= weak[1] < severe[0]


def test_nothing_known_fits_where_the_pressure_leaves_its_profile(warm: Score) -> None:
    """Where something else acts on the working pressure the tool says so and names no fault."""
    off = warm.off_profile
    assert off["cycles"] == off["cycles with unknown"]
    assert 0 == off["seconds with a fault named"]


@pytest.mark.prove
def test_temperature_in_the_pump_law_pays(warm: Score, cold: Score) -> None:
    """Without oil temperature half of the weak leakages are lost; still no false alarm."""
    assert 0 == _sum(cold.alarmed, "none")
    assert _sum(cold.leak_named, "weak") < 0.6 * _sum(warm.leak_named, "weak")


def test_labels_are_not_read_by_the_tool() -> None:
    """No product file speaks of the label file."""
    root = Path(__file__).resolve().parents[2]
    for folder in ("rulec", "runtime", "plants", "kb"):
        for file in (root / folder).rglob("*.*"):
            if file.suffix in (".py", ".yaml"):
                assert "conditions.csv" not in file.read_text(encoding="utf-8"), file
