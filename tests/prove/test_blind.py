"""A blind test of somebody's own recording: told first what shows, with how often and what else."""

import io

import pytest
from rich.console import Console

from rulec.mismatch.result import Detectability, SelfProof
from rulec.prove.blind import Blind, blind, page, show
from tests.conftest import ROOT

LEAK = Detectability(
    id="A.leakage",
    title="Leakage <in> A",
    size=10.0,
    unit="%",
    told=190,
    usual=10.0,
    told_usual=190,
    seen_from=0.68,
    other={"Slip in [b]A": 4},
)
BENT = Detectability(
    id="A.bent", title="Bent reading", size=0.1, unit="1", usual=0.1, told_usual=25
)
UNSEEN = Detectability(id="A.slip", title="Slip")
FOUND = Blind(
    "abc", "day.csv", SelfProof(replays=200, called_missing=1, effects=(UNSEEN, LEAK, BENT))
)


def test_the_surest_come_first() -> None:
    assert ["A.leakage", "A.bent"] == [e.id for e in FOUND.reported]
    assert ["Slip"] == FOUND.unseen
    assert FOUND.headline.startswith("This recording would show 1 of 3 effects")
    assert "in 1 of 200 replays" in FOUND.headline


def test_terminal_and_page_tell_the_same() -> None:
    """Names of a plant are shown as they are written, not as markup."""
    out = Console(file=io.StringIO(), width=120)
    show(out, FOUND)
    text = out.file.getvalue()  # type: ignore[attr-defined]
    html = page(FOUND)
    for word in ("190 of 200", "0.7 %", "25 of 200", "1 effect would not be found"):
        assert word in text
        assert word in html
    assert "Slip in [b]A (4)" in text
    assert "Leakage &lt;in&gt; A" in html
    assert "no size" in html


@pytest.mark.prove
def test_every_effect_of_a_plant_is_asked_for() -> None:
    plant = ROOT / "plants" / "rse-boiler"
    found = blind(plant, str(plant / "examples" / "day.csv"), lambda text: None)
    usual = {e.id: e.told_usual for e in found.proof.effects}
    assert len(usual) == 36
    assert usual["boiler.seat-deposit"] > 180
    assert found.form()["nothing"]["called_missing"] <= 10
