"""Write a self-contained plant folder: plant, knowledge base, calibration, attached files.

It is written to a temporary folder, checked, then moved into place."""

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.open_file import text_of
from rulec_runtime.output.write_file import write_text

from rulec.effects.adopt import Adopted, Adoption, adoption_of
from rulec.effects.candidate import Repair, Unwritable
from rulec.effects.model_builder import ModelBuilder
from rulec.effects.recalibrate import calibration
from rulec.effects.repair import AdoptRefused
from rulec.effects.write_module import write_module
from rulec.knowledge.fluid import reading_of
from rulec.knowledge.layers import KB, Layer, shipped
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Refused
from rulec.language.read_yaml import Document, read_document
from rulec.language.schema import kind_of
from rulec.language.write_yaml import lines, rounded
from rulec.limits import MAX_FILE_BYTES
from rulec.passes.pipeline import compile_plant

CALIBRATION = "calibration.yaml"


def plant_files(sources: Sources, adoption: Adoption, repair: Repair) -> Iterator[tuple[str, str]]:
    """Files of the new folder, as (relative path, text)."""
    assert sources.plant is not None
    values = calibration(adoption, repair)
    head = f"# Written by rulec adopt from {repair.recording or 'a recording'}."
    yield "plant.yaml", _plant(sources.plant, adoption, repair, head, bool(values["modules"]))
    if values["modules"]:
        note = "# All values of the repaired plant; what was calibrated before is in it."
        yield CALIBRATION, f"{head}\n{note}\n{yaml.safe_dump(values, sort_keys=False, width=100)}"
    for key in ("columns", "adjacency"):
        if key in sources.plant.data:
            file = Path(sources.plant.path).parent / sources.plant.data[key]
            yield file.name, text_of(file, MAX_FILE_BYTES)
    yield from knowledge_files(sources, adoption)


def _plant(plant: Document, adoption: Adoption, repair: Repair, head: str, calibrated: bool) -> str:
    old = plant.data
    modules = {
        name: _module(part, adoption.instances[name], repair, adoption)
        for name, part in old["modules"].items()
    }
    attached = {k: Path(old[k]).name for k in ("adjacency", "columns") if k in old}
    data = {**old, "modules": modules, **attached, "kb": KB}
    data.pop("calibration", None)
    if calibrated:
        data["calibration"] = [CALIBRATION]
    schema = "# yaml-language-server: $schema=kb/schema/plant.schema.json"
    return "\n".join([schema, head, *lines(data)]) + "\n"


def _module(
    part: Mapping[str, Any], own: Adopted, repair: Repair, adoption: Adoption
) -> dict[str, Any]:
    """An instance with its type, and typical readings of what its equations now read."""
    reference = dict(part.get("reference", {}))
    module = own.module
    for name, value in _typical(own, repair, adoption).items():
        if name not in module.reference:
            reference[name] = rounded(module.type.signals[name].unit.from_si(value), 6)
    changed = {**part, "type": own.type.name, "reference": reference}
    return {key: value for key, value in changed.items() if value}


def _typical(own: Adopted, repair: Repair, adoption: Adoption) -> dict[str, float]:
    """Readings (SI) of the drivers of adopted candidates: the median, or the mid-range."""
    name, result = own.module.name, dict[str, float]()
    for candidate in adoption.taken:
        for source in map(reading_of, candidate.drivers.values()):
            if source.startswith(f"{name}.") and source in repair.ranges:
                result[source.split(".")[1]] = sum(repair.ranges[source]) / 2
        for unknown in candidate.unknowns:
            at_median = unknown.fixed and len(unknown.quantiles) < 2
            if at_median and unknown.driver and unknown.driver.startswith(f"{name}."):
                result[unknown.driver.split(".")[1]] = repair.values[unknown.id]
    return {name: value for name, value in result.items() if name in own.module.type.signals}


def knowledge_files(sources: Sources, adoption: Adoption) -> Iterator[tuple[str, str]]:
    """The knowledge of all layers, with amended types instead of the old ones."""
    by_type = {d.data["module"]: d for d in sources.by_kind.get("module", ())}
    amended = {
        Path(by_type[a.module.type.name].path).resolve(): a
        for a in adoption.changed.values()
        if a.type.name == a.module.type.name
    }
    for layer in sources.layers:
        for file in layer.files:
            document, _ = (None, ()) if file.resolve() in amended else read_document(file)
            of_plants = (None, "plant", "columns", "calibration")
            if document is not None and kind_of(document) not in of_plants:
                yield _copied(layer, file), text_of(file, MAX_FILE_BYTES)
    for file in sorted((shipped(KB) / "schema").glob("*.json")):
        yield f"{KB}/schema/{file.name}", file.read_text("utf-8")
    for own in adoption.changed.values():
        document = by_type[own.module.type.name]
        taken = [c for c in adoption.taken if c.module == own.module.name]
        comments = [f"Amended by rulec adopt: {c.title} at {c.place}." for c in taken]
        text = write_module(document, own.type, own.brought, comments)
        yield f"{KB}/modules/{own.type.name}.yaml", text


def _copied(layer: Layer, file: Path) -> str:
    """The new path of a file of a layer. A layer that is no whole knowledge base gets a folder of
    its own, so that no file replaces another."""
    inside = file.relative_to(layer.folder).as_posix()
    return f"{KB}/{inside}" if layer.is_whole else f"{KB}/{layer.name.replace('/', '-')}/{inside}"


def trial(builder: ModelBuilder, repair: Repair) -> Ruleset:
    """Write a repair to a temporary folder, read and compile it; raises `Unwritable`."""
    assert builder.sources is not None
    try:
        with tempfile.TemporaryDirectory(prefix="rulec-adopt-") as folder:
            write_plant(Path(folder), builder.sources, adoption_of(builder, repair), repair)
            return compile_plant(Path(folder))
    except AdoptRefused as error:
        raise Unwritable(str(error)) from None
    except Refused as error:
        raise Unwritable(f"the compiler refuses it: {error.briefly}") from None


def write_plant(folder: Path, sources: Sources, adoption: Adoption, repair: Repair) -> None:
    """Write all files of the new plant; nobody else may write to the folder."""
    for name, text in plant_files(sources, adoption, repair):
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, text)


@contextmanager
def put_in_place(target: Path) -> Iterator[Path]:
    """A folder to write into; it takes the target's name on success, else it is removed."""
    target.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    try:
        yield folder
        folder.chmod(0o755)
        if target.is_dir():
            target.rmdir()  # empty, or it would have been refused
        folder.rename(target)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
