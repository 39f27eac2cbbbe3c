"""The adopted plant as files: written to a temporary folder, checked, then moved into place."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.write_file import write_text

from rulec.effects.adopt import Adoption, adoption_of
from rulec.effects.candidate import Repair as Found
from rulec.effects.candidate import Unwritable
from rulec.effects.model_builder import ModelBuilder
from rulec.effects.repair import AdoptRefused, Joined, Repair
from rulec.effects.write_plant import plant_files
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Refused
from rulec.passes.pipeline import compile_plant


def trial(builder: ModelBuilder, found: Found) -> Ruleset:
    """Write a repair to a temporary folder, read and compile it; raises `Unwritable`."""
    assert builder.sources is not None
    try:
        repair = _repair(builder.sources, found)
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


def _repair(sources: Sources, found: Found) -> Repair:
    assert sources.plant is not None
    values = {p.id: p.value for p in found.parameters}
    known = {**values, **found.fixed}
    return Repair(
        plant=Path(sources.plant.path),
        recording="",
        joined=tuple(
            Joined(name, {k: v for k, v in known.items() if k.startswith(f"{name}.")})
            for name in found.joined
        ),
        parameters=tuple(values),
        values=np.array(list(values.values()), dtype=float),
        covariance=found.covariance,
        misfit=found.misfit,
        ranges=found.ranges,
        curves=found.curves,
    )
