"""Pass 1, read: files to documents. No meaning yet, but every position."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from rulec.language.diagnostics import Diagnostic, Place, Refused, nearest
from rulec.language.document import Document, Path_, read_document
from rulec.language.schema import KINDS, check_schema, kind_of
from rulec.limits import MAX_FILE_BYTES

_KNOWLEDGE = ("module", "fault", "effect", "sensor", "fluid")
_EFFECT = re.compile(rb"^effect:", re.MULTILINE)
"""A file that need not be read where no effects are wanted: parsing all takes longer than a small
plant takes to compile."""

_SOURCE_MAP = re.compile(rb"^(endpoint|servers):", re.MULTILINE)
"""A map of signals to nodes or topics, which only a watch reads."""

_PACKAGE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, kw_only=True)
class Sources:
    """All documents that a plant or a check needs, by kind, with the schema already checked.

    Of module types that the plant does not have, the kind ``provider`` holds those whose provided
    names its modules may ask for, and ``other`` the rest, and fluids that do not flow in it,
    unchecked, for their names.
    """

    kb: Path
    units: Document
    by_kind: Mapping[str, tuple[Document, ...]]
    plant: Document | None = None
    columns: Document | None = None
    calibrations: tuple[Document, ...] = ()
    adjacency: tuple[str, str] | None = None

    def digest(self) -> str:
        """Hash of what a ruleset is made from, independent of layout and order."""
        parts = [self.units, self.plant, self.columns, *self.calibrations]
        used = [kind for kind in self.by_kind if kind not in ("provider", "other", "effect")]
        parts += [d for kind in used for d in self.by_kind[kind]]
        texts = sorted(json.dumps(d.data, sort_keys=True) for d in parts if d is not None)
        texts.append(self.adjacency[1] if self.adjacency else "")
        return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]

    def connected(self, connections: Iterable[tuple[str, str]]) -> Sources:
        """The same with other connections, given as a list; places stay those of the files."""
        assert self.plant is not None
        data = {key: part for key, part in self.plant.data.items() if key != "adjacency"}
        data["connections"] = [f"{source} -> {target}" for source, target in connections]
        return replace(self, plant=replace(self.plant, data=data), adjacency=None)

    def names(self, kind: str) -> set[str]:
        """Names of all module types or fluids of the knowledge base, for messages."""
        documents = [d for k in (kind, "provider", "other") for d in self.by_kind.get(k, ())]
        return {str(d.data[kind]) for d in documents if kind in d.data}


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
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def read_plant(path: Path, effects: bool = False) -> Sources:
    """Read a plant (folder or its plant.yaml) with all it refers to.

    Only a comparison with recordings needs `effects`; no ruleset depends on them.

    Raises `Refused` with every mistake of form found in any file.
    """
    file = path / "plant.yaml" if path.is_dir() else path
    found: list[Diagnostic] = []
    plant = _read(file, "plant", found)
    if plant is None:
        raise Refused(found)
    kb = find_kb(file.parent)
    if plant.data.get("kb"):
        kb = file.parent / plant.data["kb"]
        if not os.path.isfile(kb / "units.yaml"):
            message = f"there is no knowledge base in '{plant.data['kb']}'"
            hint = "a folder with a units.yaml, as seen from this file"
            raise Refused([Diagnostic(plant.place("kb"), "KB001", message, hint)])
    modules = plant.data["modules"].values()
    wanted = {
        "module": {str(m["type"]) for m in modules},
        "fluid": {str(part["fluid"]) for part in (plant.data, *modules) if "fluid" in part},
    }
    by_kind = _read_kb(kb, found, wanted, effects=effects)
    columns = None
    if "columns" in plant.data:
        columns = _read_attached(plant, file, "columns", ("columns",), found)
    calibrations = _read_calibrations(plant, file, found)
    adjacency = _read_adjacency(plant, file, found)
    if not found and "units" not in by_kind:
        found.append(_no_units(kb))
    if found:
        raise Refused(found)
    kept = tuple(d for d in calibrations if d is not None)
    return Sources(
        kb=kb,
        units=by_kind["units"][-1],
        by_kind=by_kind,
        plant=plant,
        columns=columns,
        calibrations=kept,
        adjacency=adjacency,
    )


def read_files(paths: Iterable[Path]) -> tuple[Sources | None, list[Document], list[Diagnostic]]:
    """Read single files or folders for `rulec check`, with the knowledge base around them.

    Returns the knowledge sources, the plant documents found, and mistakes of form.
    """
    found: list[Diagnostic] = []
    files = sorted({f for path in paths for f in _yaml_files(path, found)})
    if not files:
        return None, [], found
    own = [file.parent for file in files if file.name == "units.yaml"]
    kb = own[0] if own else find_kb(files[0].parent)
    given: dict[str, list[Document]] = {kind: [] for kind in KINDS}
    for file in files:
        document = _read(file, None, found)
        if document is not None:
            given[kind_of(document) or ""].append(document)
    around = _read_kb(kb, found, None, frozenset(files))
    units = [*given["units"], *around.get("units", ())]
    if not units:
        found += [] if found else [_no_units(kb)]
        return None, given["plant"], found
    merged = {k: (*around.get(k, ()), *given[k]) for k in _KNOWLEDGE}
    return Sources(kb=kb, units=units[0], by_kind=merged), given["plant"], found


def read_alone(path: Path, kind: str) -> tuple[Document, Document]:
    """Read a file that no plant names, and the units around it.

    Raises `Refused` with every mistake of form.
    """
    found: list[Diagnostic] = []
    document = _read(path, kind, found)
    kb = find_kb(path.parent)
    units = _read(kb / "units.yaml", "units", found) if not found else None
    if document is None or units is None:
        raise Refused(found)
    return document, units


def _no_units(kb: Path) -> Diagnostic:
    message = "this knowledge base has no list of units"
    hint = "it needs a units.yaml; is RULEC_KB right?"
    return Diagnostic(Place(kb.as_posix()), "KB001", message, hint)


def _yaml_files(path: Path, found: list[Diagnostic]) -> list[Path]:
    if path.is_dir():
        files = [file for file in yaml_files_in(path) if not _holds(_SOURCE_MAP, file)]
        if not files:
            message = "there is no YAML file in this folder"
            hint = "the files of a plant end in .yaml"
            found.append(Diagnostic(Place(path.as_posix()), "KB001", message, hint))
        return files
    return [path]


def yaml_files_in(folder: Path) -> list[Path]:
    """YAML files of a folder, without those in hidden folders."""
    files = (f for f in folder.rglob("*") if f.suffix in (".yaml", ".yml") and f.is_file())
    return sorted(f for f in files if not any(p[0] == "." for p in f.relative_to(folder).parts))


def _read_kb(
    kb: Path,
    found: list[Diagnostic],
    wanted: Mapping[str, set[str]] | None,
    given: frozenset[Path] = frozenset(),
    effects: bool = True,
) -> dict[str, tuple[Document, ...]]:
    """Read the knowledge base without the given files; only what is wanted (None: all)."""
    by_kind: dict[str, list[Document]] = {}
    skip = {os.path.realpath(file) for file in given}
    for file in yaml_files_in(kb):
        if not effects and _holds(_EFFECT, file):
            continue
        document = None if os.path.realpath(file) in skip else _open(file, None, found)
        if document is None:
            continue
        kind = kind_of(document) or ""
        mistakes = found
        if wanted is not None and kind in wanted and str(document.data[kind]) not in wanted[kind]:
            kind, mistakes = "provider", []
        if kind == "provider" and "provides" not in document.data:
            by_kind.setdefault("other", []).append(document)
        elif _conforms(document, mistakes):
            by_kind.setdefault(kind, []).append(document)
    return {kind: tuple(documents) for kind, documents in by_kind.items()}


def _holds(key: re.Pattern[bytes], file: Path) -> bool:
    """Whether a file has a key, without parsing it; an unreadable one is not skipped."""
    try:
        with file.open("rb") as stream:
            return key.search(stream.read(MAX_FILE_BYTES)) is not None
    except OSError:
        return False


def _read(
    file: Path, kind: str | None, found: list[Diagnostic], asked: Place | None = None
) -> Document | None:
    """Read one file and check its schema; mistakes are added to `found`."""
    document = _open(file, kind, found, asked)
    return document if document is not None and _conforms(document, found) else None


def _open(
    file: Path, kind: str | None, found: list[Diagnostic], asked: Place | None = None
) -> Document | None:
    """Read one file, which must be of the given kind, or of any; `asked` is who wants it."""
    document, mistakes = read_document(file)
    found.extend(mistakes)
    if document is None:
        return None
    actual = kind_of(document)
    if actual is not None and kind in (None, actual):
        return document
    first = list(document.data)[:1] if isinstance(document.data, dict) else []
    near = nearest(first[0], KINDS) if first else None
    if actual is not None:
        expected, hint = f"a {kind} file", f"its first key should be '{kind}'"
    else:
        expected, hint = "a file of this tool", "first key: " + ", ".join(KINDS)
        hint = f"did you mean '{near}'?" if near and near != first[0] else hint
    place = document.key(*first)
    found.append(Diagnostic(place, "KB012", f"this is not {expected}", hint, asked))
    return None


def _conforms(document: Document, found: list[Diagnostic]) -> bool:
    mistakes = check_schema(document, kind_of(document) or "", shipped("kb") / "schema")
    found.extend(mistakes)
    return not mistakes


def _read_attached(
    plant: Document, file: Path, kind: str, path: Path_, found: list[Diagnostic]
) -> Document | None:
    """Read the file that the plant names at a path."""
    place, name = plant.place(*path), plant.data
    for step in path:
        name = name[step]
    if not os.path.isfile(file.parent / name):
        message, hint = f"there is no file '{name}'", "a path as seen from this file"
        found.append(Diagnostic(place, "KB001", message, hint))
        return None
    return _read(file.parent / name, kind, found, place)


def _read_calibrations(
    plant: Document, file: Path, found: list[Diagnostic]
) -> list[Document | None]:
    """Read each calibration that the plant names; one that is named twice is not read at all."""
    named: dict[str, int] = {}
    for i, name in enumerate(plant.data.get("calibration", ())):
        first = named.setdefault(os.path.realpath(file.parent / name), i)
        if first != i:
            message, place = f"'{name}' is named twice", plant.place("calibration", i)
            second = plant.place("calibration", first)
            found.append(Diagnostic(place, "KB015", message, "name each file once", second))
            return []
    return [
        _read_attached(plant, file, "calibration", ("calibration", i), found)
        for i in named.values()
    ]


def _read_adjacency(plant: Document, file: Path, found: list[Diagnostic]) -> tuple[str, str] | None:
    name = plant.data.get("adjacency")
    if name is None:
        return None
    place = plant.place("adjacency")
    try:
        with (file.parent / name).open("rb") as stream:
            text = stream.read(MAX_FILE_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        found.append(Diagnostic(place, "KB003", f"'{name}' is not UTF-8", "save it as UTF-8"))
        return None
    except (OSError, ValueError):
        message, hint = f"there is no file '{name}'", "a path as seen from this file"
        found.append(Diagnostic(place, "KB001", message, hint))
        return None
    return name, text
