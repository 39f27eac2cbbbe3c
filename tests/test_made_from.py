"""What an analysis was made from: several recordings, by hash, in the order given."""

from __future__ import annotations

from pathlib import Path

import pytest

from rulec.effects.made_from import basis_of, check_unchanged
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.effects.repair import AdoptRefused, Basis
from tests.conftest import ROOT


@pytest.fixture
def builder() -> ModelBuilder:
    return open_builder(ROOT / "plants" / "abc")[1]


def asked(builder: ModelBuilder, given: list[Path]) -> Basis:
    data = basis_of(builder.sources, given)
    return Basis(data["plant"], tuple(data["given"]), data["recordings"])


def recordings(folder: Path) -> list[Path]:
    """A file, and a folder with one."""
    (folder / "more").mkdir()
    for name in ("b.csv", "more/a.csv"):
        (folder / name).write_text(f"time [s]\n{len(name)}\n", encoding="utf-8")
    return [folder / "b.csv", folder / "more"]


def test_all_recordings_come_back_in_the_order_given(builder: ModelBuilder, tmp_path: Path) -> None:
    given = recordings(tmp_path)
    basis = asked(builder, given)
    assert builder.sources is not None
    assert [path.resolve() for path in given] == check_unchanged(basis, builder.sources)
    assert 2 == len(basis.recordings)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda folder: (folder / "more" / "a.csv").write_text("new"), "a.csv' has changed"),
        (lambda folder: (folder / "more" / "z.csv").write_text("new"), "z.csv' is new"),
        (lambda folder: (folder / "b.csv").unlink(), "b.csv' is not there any more"),
    ],
)
def test_a_change_of_any_of_them_is_refused(
    builder: ModelBuilder, tmp_path: Path, change: object, said: str
) -> None:
    """Which file, and what to do."""
    basis = asked(builder, recordings(tmp_path))
    assert callable(change)
    change(tmp_path)
    assert builder.sources is not None
    with pytest.raises(AdoptRefused) as refused:
        check_unchanged(basis, builder.sources)
    assert said in str(refused.value)
    assert "run rulec mismatch again" in str(refused.value)
