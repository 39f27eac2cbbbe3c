"""Rigs made from recipes and a copy of the source: the recipes, and what they make."""

import csv
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from rulec_runtime.output.refusal import Refusal

from rulec.cli import main
from rulec.prove.real.make import made
from rulec.prove.real.rig_folder import ALARMS, checked, false_alarms_in, open_text, rigs_in
from tests.conftest import ROOT, plain_yaml
from tests.rig import real

RECIPES, SHIPPED = ROOT / "tests" / "rig" / "recipes", ROOT / "tests" / "rig" / "shipped"
QUICK = ("cascaded-tanks", "esp-p37-water", "pipeline", "pump-throttled", "rse-boiler")
"""Recipes of small sources."""


def test_recipes_keep_to_their_form() -> None:
    """What they name is there; false alarms are those of rigs that a recipe makes."""
    names = set()
    for file in sorted(RECIPES.glob("*.yaml")):
        if file.name != ALARMS:
            recipe = checked(file, "recipe")
            assert file.stem == recipe["recipe"]
            assert (file.parent / recipe["plant"]).is_file()
            names.add(recipe["recipe"])
    assert {alarm.rig for alarm in false_alarms_in(RECIPES)} <= names


def test_a_wrong_recipe_is_told(tmp_path: Path) -> None:
    """A column that the source lacks, conditions that no row meets, no recipe at all."""
    with pytest.raises(Refusal, match="there is no recipe in it"):
        list(made(tmp_path, tmp_path, tmp_path))
    assert 1 == main(["prove", "--make-rigs", str(RECIPES), str(tmp_path), str(tmp_path / "out")])
    (tmp_path / "a.csv").write_text("t,x\n0,1\n1,2\n", encoding="utf-8")
    recipe = plain_yaml(RECIPES / "pipeline.yaml") | {"files": ["a.csv"]}
    recipe["plant"] = str(ROOT / "plants" / "rse-boiler" / "plant.yaml")
    del recipe["knowledge"]
    for rows, why in (
        ([{"column": "y", "is": [1]}], "no column 'y'"),
        ([{"column": "x", "from": 3}], "no row of the source meets"),
    ):
        (tmp_path / "r.yaml").write_text(json.dumps(recipe | {"train": {"rows": rows}}))
        with pytest.raises(Refusal, match=why):
            list(made(tmp_path, tmp_path, tmp_path / "out"))


def _made(tmp_path: Path, chosen: tuple[str, ...]) -> Path:
    """Rigs of some recipes, where the recordings are."""
    source = real()
    few = tmp_path / "tests" / "rig" / "recipes"
    few.mkdir(parents=True)
    for name in ("plants", "tests/rig/plants"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in chosen:
        shutil.copyfile(RECIPES / f"{name}.yaml", few / f"{name}.yaml")
    words = [str(few), str(source), str(tmp_path / "made")]
    assert 0 == main(["prove", "--make-rigs", *words])
    return tmp_path / "made"


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _made(tmp_path_factory.mktemp("quick"), QUICK)


def test_recipes_make_rigs(quick: Path) -> None:
    """That are in order; what is shipped is what its recipe makes."""
    assert list(QUICK) == [rig.name for rig in rigs_in(quick)]
    for file in (SHIPPED / "rse-boiler").iterdir():
        if file.is_file():
            assert file.read_bytes() == (quick / "rse-boiler" / file.name).read_bytes()


def test_unseen_rows_are_other_rows(quick: Path) -> None:
    """No row is shown and judges."""

    def rows(file: Path) -> Iterator[tuple[str, ...]]:
        with open_text(file) as source:
            yield from map(tuple, csv.reader(source))

    for rig in rigs_in(quick):
        shown = {row for file in rig.train for row in rows(file)}
        assert 1 == len(shown & set(rows(rig.test))), "the header alone"


@pytest.mark.prove
def test_every_recipe_makes_a_rig(tmp_path: Path) -> None:
    names = tuple(sorted(f.stem for f in RECIPES.glob("*.yaml") if f.name != ALARMS))
    assert list(names) == [rig.name for rig in rigs_in(_made(tmp_path, names))]
