"""Make rigs from recipes and a copy of the source: `rulec prove --make-rigs`.

A recipe states in YAML which rows and columns of which files are for training and for the test, the
plant that belongs to them, and what is known. If a licence forbids passing on a recording, its
recipe can still be passed on.
"""

import csv
import io
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.write_file import write_text

from rulec.language.read_yaml import read_document
from rulec.prove.real.rig_folder import (
    ABOUT,
    ALARMS,
    ANSWER,
    EARLIER,
    PLAIN,
    PLANT,
    SEAL,
    TEST,
    TRAIN,
    checked,
    digest_of,
    open_text,
    write_packed,
    write_yaml,
)

Row = Mapping[str, str]
Recipe = Mapping[str, Any]


def made(recipes: Path, source: Path, target: Path) -> Iterator[tuple[str, str]]:
    """Make every rig whose source exists; yields its name, and why it was left out, if so.

    Raises `Refusal` if a recipe is wrong.
    """
    files = sorted(f for f in recipes.glob("*.yaml") if f.name != ALARMS)
    if not files:
        raise Refusal(f"--make-rigs {recipes}: there is no recipe in it; a recipe is a .yaml file")
    for file in files:
        recipe = checked(file, "recipe")
        parts = [recipe[part] for part in (TRAIN, TEST, EARLIER) if part in recipe]
        names = {name for part in parts for name in _files(recipe, part)}
        names |= {recipe["labels"]["file"]} if "labels" in recipe else set()
        absent = sorted(name for name in names if not (source / name).is_file())
        if not absent:
            make(file, recipe, source, target / recipe["recipe"])
        yield recipe["recipe"], f"{absent[0]} is not in {source}" if absent else ""
    if (recipes / ALARMS).is_file():
        shutil.copyfile(recipes / ALARMS, target / ALARMS)


def make(file: Path, recipe: Recipe, source: Path, folder: Path) -> None:
    """Write the folder of a rig; replaces an existing one."""
    if folder.exists():
        shutil.rmtree(folder)
    _plain(file, recipe, folder / PLAIN)
    for part in (TRAIN, TEST, EARLIER):
        if part in recipe:
            write_packed(folder / f"{part}.csv.gz", _table(file, recipe, part, source))
    write_yaml(folder / ABOUT, {"rig": recipe["recipe"], **recipe["rig"]})
    if "answer" in recipe:
        write_yaml(folder / ANSWER, recipe["answer"])
        write_text(folder / SEAL, f"{digest_of(folder / ANSWER)}  {ANSWER}\n")
    if "licence_file" in recipe:
        shutil.copyfile(file.parent / recipe["licence_file"], folder / "LICENSE")


def _files(recipe: Recipe, part: Recipe) -> Sequence[str]:
    found: Sequence[str] = part.get("files", recipe.get("files", ()))
    return found


def _plain(file: Path, recipe: Recipe, target: Path) -> None:
    """Copy the plant file, the files it names, and its own module types."""
    plant = file.parent / recipe["plant"]
    document, wrong = read_document(plant)
    if document is None:
        raise Refusal(f"{file}: plant: {wrong[0].message}; give the path of a plant file from here")
    target.mkdir(parents=True)
    shutil.copyfile(plant, target / PLANT)
    named = [document.data.get(key) for key in ("columns", "adjacency")]
    for name in filter(None, [*named, *document.data.get("calibration", ())]):
        shutil.copyfile(plant.parent / name, target / name)
    for name in recipe.get("knowledge", ()):
        (target / "kb" / "modules").mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file.parent / name, target / "kb" / "modules" / Path(name).name)


def _table(file: Path, recipe: Recipe, part: str, source: Path) -> str:
    """Rows of a part as CSV; raises `Refusal` if a column is absent or no row is left."""
    wanted, left_out = recipe[part], recipe.get("without", ())
    conditions = wanted.get("rows", ())
    out, count = io.StringIO(), 0
    writer = csv.writer(out, lineterminator="\n")
    for row in _rows(recipe, _files(recipe, wanted), source):
        try:
            if not all(_meets(row, condition) for condition in conditions):
                continue
            every = (t for t in row if not t.startswith("label.") and t not in left_out)
            columns = recipe.get("columns") or {title: {"from": title} for title in every}
            if not count:
                writer.writerow(columns)
            writer.writerow([_cell(row, column, count) for column in columns.values()])
        except KeyError as absent:
            raise Refusal(f"{file}: {part}: the source has no column {absent}") from None
        count += 1
    if not count:
        raise Refusal(f"{file}: {part}: no row of the source meets these conditions")
    return out.getvalue()


def _rows(recipe: Recipe, files: Sequence[str], source: Path) -> Iterator[Row]:
    """Rows of the source with their labels, under `label.NAME`."""
    labels: dict[str, Row] = {}
    by = recipe["labels"]["by"] if "labels" in recipe else ""
    if by:
        with open_text(source / recipe["labels"]["file"]) as table:
            for row in csv.DictReader(table):
                labels[row[by]] = {f"label.{key}": value for key, value in row.items()}
    for name in files:
        with open_text(source / name) as table:
            for row in csv.DictReader(table):
                yield {**row, **labels.get(row[by], {})} if by else row


def _cell(row: Row, column: Recipe, count: int) -> str:
    """A cell of the source, scaled, or a difference or quotient of two, or a number."""
    if "rows" in column or "value" in column:
        return f"{column['value'] if 'value' in column else count * column['rows']:.10g}"
    if not {"less", "over", "scale"} & set(column):
        return row[column["from"]]
    value = float(row[column["from"]]) * column.get("scale", 1.0)
    value -= float(row[column["less"]]) if "less" in column else 0.0
    return f"{value / float(row[column['over']]) if 'over' in column else value:.10g}"


def _meets(row: Row, condition: Recipe) -> bool:
    """Whether a row meets a condition; texts, such as dates, are compared as texts."""
    cell = row[condition["column"]]

    def value(bound: float | str) -> float | str:
        return cell if isinstance(bound, str) else float(cell)

    tests: dict[str, Callable[[Any], bool]] = {
        "from": lambda bound: value(bound) >= bound,
        "below": lambda bound: value(bound) < bound,
        "is": lambda values: any(value(v) == v for v in values),
        "not": lambda values: all(value(v) != v for v in values),
    }
    return all(test(condition[key]) for key, test in tests.items() if key in condition)
