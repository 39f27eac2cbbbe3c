"""Pass 1, read: files to documents. No meaning yet, but every position."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rulec.diagnostics import Diagnostic, Place, Refused, did_you_mean
from rulec.document import Document, read_document
from rulec.schema import KINDS, check_schema, kind_of

_ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Sources:
    """All documents that a plant or a check needs, by kind, with the schema already checked."""

    kb: Path
    units: Document
    by_kind: Mapping[str, tuple[Document, ...]]
    plant: Document | None = None
    columns: Document | None = None
    calibrations: tuple[Document, ...] = ()
    adjacency: tuple[str, str] | None = None

    def digest(self) -> str:
        """Hash of the content of all documents, independent of layout and order."""
        parts = [self.units, self.plant, self.columns, *self.calibrations]
        parts += [d for kind in sorted(self.by_kind) for d in self.by_kind[kind]]
        texts = sorted(json.dumps(d.data, sort_keys=True) for d in parts if d is not None)
        texts.append(self.adjacency[1] if self.adjacency else "")
        return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]


def find_kb(near: Path) -> Path:
    """Folder of the knowledge base: RULEC_KB, or the nearest `kb/` upwards, or the shipped one."""
    chosen = os.environ.get("RULEC_KB")
    if chosen:
        return Path(chosen)
    for folder in (near, *near.resolve().parents):
        if (folder / "kb" / "units.yaml").is_file():
            return folder / "kb"
        if (folder / "units.yaml").is_file():
            return folder
    return shipped("kb")


def shipped(name: str) -> Path:
    """A folder that comes with the tool, in a checkout or in an installed package."""
    inside = Path(__file__).resolve().parent / name
    return inside if inside.is_dir() else _ROOT / name


def read_plant(path: Path) -> Sources:
    """Read a plant (folder or its plant.yaml) with all it refers to.

    Raises `Refused` with every mistake of form found in any file.
    """
    file = path / "plant.yaml" if path.is_dir() else path
    found: list[Diagnostic] = []
    plant = _read(file, "plant", found, find_kb(file.parent))
    if plant is None:
        raise Refused(found)
    kb = find_kb(file.parent)
    if plant.data.get("kb"):
        kb = file.parent / plant.data["kb"]
        if not (kb / "units.yaml").is_file():
            message = f"there is no knowledge base in '{plant.data['kb']}'"
            raise Refused([Diagnostic(plant.place("kb"), "KB001", message)])
    wanted = {str(m["type"]) for m in plant.data["modules"].values()}
    units, by_kind = _read_kb(kb, found, wanted)
    columns = _read_attached(plant, file, kb, "columns", "columns", found)
    calibrations = [
        _read_listed(plant, file, kb, i, found)
        for i in range(len(plant.data.get("calibration", ())))
    ]
    adjacency = _read_adjacency(plant, file, found)
    if found or units is None:
        raise Refused(found)
    kept = tuple(d for d in calibrations if d is not None)
    return Sources(kb, units, by_kind, plant, columns, kept, adjacency)


def read_files(paths: Iterable[Path]) -> tuple[Sources | None, list[Document], list[Diagnostic]]:
    """Read single files or folders for `rulec check`, with the knowledge base around them.

    Returns the knowledge sources, the plant documents found, and mistakes of form.
    """
    found: list[Diagnostic] = []
    files = sorted({f for path in paths for f in _yaml_files(path, found)})
    if not files:
        return None, [], found
    kb = find_kb(files[0].parent)
    given: dict[str, list[Document]] = {kind: [] for kind in KINDS}
    for file in files:
        document = _read(file, None, found, kb)
        if document is not None:
            given[kind_of(document) or ""].append(document)
    units, around = _read_kb(kb, found, None, skip={f.resolve() for f in files})
    if units is None and given["units"]:
        units = given["units"][0]
    if units is None:
        return None, given["plant"], found
    merged = {k: (*around.get(k, ()), *given[k]) for k in ("module", "fault", "sensor", "fluid")}
    return Sources(kb, units, merged), given["plant"], found


def _yaml_files(path: Path, found: list[Diagnostic]) -> list[Path]:
    if path.is_dir():
        files = [f for f in path.rglob("*.y*ml") if f.is_file()]
        if not files:
            found.append(Diagnostic(Place(path.as_posix()), "KB001", "no YAML file in this folder"))
        return sorted(files)
    return [path]


def _read_kb(
    kb: Path,
    found: list[Diagnostic],
    wanted: set[str] | None,
    skip: set[Path] = frozenset(),  # type: ignore[assignment]
) -> tuple[Document | None, dict[str, tuple[Document, ...]]]:
    """Read the knowledge base; of modules only the wanted types (None: all)."""
    units: Document | None = None
    by_kind: dict[str, list[Document]] = {}
    for file in sorted(kb.rglob("*.yaml")):
        if file.resolve() in skip:
            continue
        document = _read(file, None, found, kb, wanted)
        if document is None:
            continue
        kind = kind_of(document) or ""
        if kind == "units":
            units = document
        by_kind.setdefault(kind, []).append(document)
    return units, {kind: tuple(documents) for kind, documents in by_kind.items()}


def _read(
    file: Path,
    kind: str | None,
    found: list[Diagnostic],
    kb: Path,
    wanted: set[str] | None = None,
) -> Document | None:
    """Read one file and check its schema; mistakes are added to `found`."""
    document, mistakes = read_document(file)
    found.extend(mistakes)
    if document is None:
        return None
    actual = kind_of(document)
    if actual is None or (kind and actual != kind):
        expected = f"a {kind} file" if kind else "a file of this tool"
        hint = f"its first key should be '{kind}'" if kind else "first key: " + ", ".join(KINDS)
        if isinstance(document.data, dict) and document.data and not kind:
            near = did_you_mean(next(iter(document.data)), KINDS)
            hint = near if near.startswith("did") else hint
        found.append(Diagnostic(document.place(), "KB012", f"this is not {expected}", hint))
        return None
    if actual == "module" and wanted is not None and document.data["module"] not in wanted:
        return None
    mistakes = check_schema(document, actual, shipped("kb") / "schema")
    found.extend(mistakes)
    return None if mistakes else document


def _read_attached(
    plant: Document, file: Path, kb: Path, key: str, kind: str, found: list[Diagnostic]
) -> Document | None:
    name = plant.data.get(key)
    if name is None:
        return None
    return _read_reference(plant.place(key), file.parent / name, kind, found, kb)


def _read_listed(
    plant: Document, file: Path, kb: Path, index: int, found: list[Diagnostic]
) -> Document | None:
    name = plant.data["calibration"][index]
    place = plant.place("calibration", index)
    return _read_reference(place, file.parent / name, "calibration", found, kb)


def _read_reference(
    place: Place, path: Path, kind: str, found: list[Diagnostic], kb: Path
) -> Document | None:
    if not path.is_file():
        found.append(Diagnostic(place, "KB001", f"there is no file '{path.name}' beside the plant"))
        return None
    return _read(path, kind, found, kb)


def _read_adjacency(plant: Document, file: Path, found: list[Diagnostic]) -> tuple[str, str] | None:
    name = plant.data.get("adjacency")
    if name is None:
        return None
    try:
        return name, (file.parent / name).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        place = plant.place("adjacency")
        found.append(Diagnostic(place, "KB001", f"cannot read '{name}': {error}"))
        return None
