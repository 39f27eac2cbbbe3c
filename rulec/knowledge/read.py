"""Pass 1, read: files to documents with the positions of all parts, not yet their meaning."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.output.open_file import begin_of, is_near
from rulec_runtime.output.refusal import Misused

from rulec.knowledge.layers import (
    KB,
    PLANT,
    UNITS,
    Layer,
    layers_around,
    layers_of,
    leads_out,
    plant_file,
    root_of,
    yaml_files_in,
)
from rulec.knowledge.read_layers import (
    KNOWLEDGE,
    conforms,
    in_use,
    open_document,
    read_layers,
)
from rulec.knowledge.sources import LayerDocuments, Sources
from rulec.knowledge.tables import with_tables
from rulec.language.diagnostics import Diagnostic, Place, Refused
from rulec.language.read_yaml import Document, Path_, read_document
from rulec.language.schema import kind_of
from rulec.limits import MAX_FILE_BYTES


def read_plant(path: Path, effects: bool = False, new_map: bool = False) -> Sources:
    """Read a plant (folder or its plant.yaml) with all files it refers to.

    Only a comparison with recordings needs `effects`; no ruleset depends on them. With `new_map`
    the column map need not exist yet. Raises `Refused` with all mistakes of form in any file.
    """
    file = plant_file(path)
    found: list[Diagnostic] = []
    plant = _read(file, "plant", found)
    if plant is None:
        raise Refused(found)
    modules = plant.data["modules"].values()
    wanted = {
        "module": {str(m["type"]) for m in modules},
        "fluid": {str(part["fluid"]) for part in (plant.data, *modules) if "fluid" in part},
    }
    columns = None
    named = plant.data.get("columns")
    if named is not None and not (new_map and not os.path.lexists(file.parent / named)):
        columns = _read_attached(plant, file, ("columns",), found)
    calibrations = tuple(_read_calibrations(plant, file, found))
    adjacency = _read_adjacency(plant, file, found)
    layers = layers_of(file.parent, _named(plant))
    contents = read_layers(layers, wanted, effects=effects)
    naming = [d for d in (plant, columns, *calibrations) if d is not None]
    own = {"plant": plant, "columns": columns, "calibrations": calibrations, "adjacency": adjacency}
    return _sources(contents, in_use(contents, naming), found, **own)


def read_all(plant: Path | None) -> Sources:
    """All knowledge that applies to a plant, used or not, or by default to the working folder.

    Raises `Refused` with all mistakes of form.
    """
    found: list[Diagnostic] = []
    if plant is None:
        layers = layers_around(Path())
    else:
        file = plant_file(plant)
        document = _read(file, "plant", found)
        if document is None:
            raise Refused(found)
        layers = layers_of(file.parent, _named(document))
    contents = read_layers(layers)
    return _sources(contents, contents, found)


def read_files(paths: Iterable[Path]) -> tuple[list[Sources], list[Document], list[Diagnostic]]:
    """Read single files or folders for `rulec check`, with the knowledge around them.

    Returns sources for each folder of knowledge that contains some of the files, the plant
    documents found, and mistakes of form.
    """
    found: list[Diagnostic] = []
    plants: list[Document] = []
    groups: dict[Path | None, list[tuple[Path, Document]]] = {}
    for file in sorted({f for path in paths for f in _yaml_files(path, found)}):
        document = _read(file, None, found)
        if document is None:
            continue
        kind = kind_of(document)
        if kind == "plant":
            plants.append(document)
        elif kind in (*KNOWLEDGE, "units"):
            groups.setdefault(root_of(file), []).append((file, with_tables(document, found)))
    result = []
    for given in groups.values():
        try:
            layers = _layers_around(given[0][0])
        except Refused as refused:
            found += refused.diagnostics
            continue
        contents = read_layers(layers, given=[file for file, _ in given])
        by_kind = _merged(contents, contents, found)
        for _, document in given:
            kind = kind_of(document) or ""
            by_kind[kind] = (*by_kind.get(kind, ()), document)
        if "units" in by_kind:
            own = tuple(document for _, document in given)
            result.append(Sources(contents=tuple(contents), by_kind=by_kind, given=own))
    return result, plants, found


def read_around(near: Path, modules: Iterable[str] = ()) -> Sources:
    """Knowledge around a folder, with some module types, but without fluids and effects.

    Raises `Refused`.
    """
    wanted = {"module": set(modules), "fluid": set[str]()}
    contents = read_layers(layers_around(near), wanted, effects=False)
    return _sources(contents, contents, [])


def read_type(name: str, near: Path) -> tuple[Document, Sources]:
    """A module type as written, with its tables, and the sources around the folder `near`.

    Raises `Refused`, or `Misused` if there is no such type.
    """
    sources = read_around(near, [name])
    named = [d for d in sources.by_kind.get("module", ()) if d.data["module"] == name]
    if not named:
        hint = did_you_mean(name, sources.names("module"))
        raise Misused(f"there is no module type '{name[:70]}'; {hint}")
    document, mistakes = read_document(Path(named[0].path))
    if document is None:
        raise Refused(mistakes)
    return document, sources


def read_alone(path: Path, kind: str) -> tuple[Document, tuple[Document, ...]]:
    """Read a file that no plant names, and the lists of units around it.

    Raises `Refused` with all mistakes of form.
    """
    found: list[Diagnostic] = []
    document = _read(path, kind, found)
    if document is None:
        raise Refused(found)
    layers = layers_of(path.parent, _named_beside(path))
    lists = (layer.folder / UNITS for layer in layers)
    units = [_read(file, "units", found) for file in lists if file.is_file()]
    if found:
        raise Refused(found)
    return document, tuple(d for d in units if d is not None)


def _layers_around(file: Path) -> tuple[Layer, ...]:
    """Layers that apply to a file of knowledge, including its own; raises `Refused` (KB001)."""
    root = root_of(file)
    if root is None:
        return layers_around(file.parent)
    beside = root.parent / PLANT
    if root.name == KB and beside.is_file():
        return layers_of(root.parent, _named_beside(beside))
    return layers_around(root, root)


def _named(plant: Document) -> list[tuple[str, Place]]:
    """Folders of knowledge that a plant names, with their places."""
    names = plant.data.get("kb", [])
    if isinstance(names, str):
        return [(names, plant.place("kb"))]
    return [(name, plant.place("kb", i)) for i, name in enumerate(names)]


def _named_beside(file: Path) -> list[tuple[str, Place]]:
    """Folders of knowledge that the plant in the folder of a file names, if there is one."""
    plant, _ = read_document(file.parent / PLANT)
    return _named(plant) if plant is not None and kind_of(plant) == "plant" else []


def _merged(
    contents: Sequence[LayerDocuments], used: Sequence[LayerDocuments], found: list[Diagnostic]
) -> dict[str, tuple[Document, ...]]:
    """Documents of the layers that apply, by kind; of the other layers only those for names.

    The shipped layer comes first: if two names clash, the one nearer to the plant is reported.
    """
    result: dict[str, list[Document]] = {}
    for part in reversed(contents):
        if part in used:
            found += part.mistakes
        for kind, documents in part.by_kind.items():
            if part in used:
                result.setdefault(kind, []).extend(documents)
            elif kind in ("provider", "other"):
                result.setdefault("other", []).extend(documents)
    return {kind: tuple(documents) for kind, documents in result.items()}


def _sources(
    contents: Sequence[LayerDocuments],
    used: Sequence[LayerDocuments],
    found: list[Diagnostic],
    **own: Any,
) -> Sources:
    """Sources from the documents of layers and a plant's own; raises `Refused` with mistakes."""
    by_kind = _merged(contents, used, found)
    if found:
        raise Refused(found)
    return Sources(contents=tuple(contents), by_kind=by_kind, **own)


def _yaml_files(path: Path, found: list[Diagnostic]) -> list[Path]:
    if path.is_dir():
        files = yaml_files_in(path)
        if not files:
            message = "there is no YAML file in this folder"
            hint = "the files of a plant end in .yaml"
            found.append(Diagnostic(Place(path.as_posix()), "KB001", message, hint))
        near = {file: is_near(file, path) for file in files}
        found.extend(leads_out(Place(file.as_posix())) for file in files if not near[file])
        return [file for file in files if near[file]]
    return [path]


def _read(
    file: Path, kind: str | None, found: list[Diagnostic], named_at: Place | None = None
) -> Document | None:
    """Read one file and check its schema; mistakes are added to `found`."""
    document = open_document(file, kind, found, named_at)
    return document if document is not None and conforms(document, found) else None


def _read_attached(
    plant: Document, file: Path, path: Path_, found: list[Diagnostic]
) -> Document | None:
    """Read the file that the plant names at a path, which begins with its kind."""
    place, name = plant.place(*path), plant.data
    for step in path:
        name = name[step]
    if not _may_be_read(file, name, place, found):
        return None
    return _read(file.parent / name, str(path[0]), found, place)


def _may_be_read(file: Path, name: str, place: Place, found: list[Diagnostic]) -> bool:
    """Whether a plant file may name this file and it exists; otherwise this is reported."""
    if not is_near(file.parent / name, file.parent):
        found.append(leads_out(place, name))
        return False
    if not os.path.isfile(file.parent / name):
        is_other = os.path.exists(file.parent / name)
        message = f"'{name}' is no regular file" if is_other else f"there is no file '{name}'"
        found.append(Diagnostic(place, "KB001", message, "a path as seen from this file"))
        return False
    return True


def _read_calibrations(plant: Document, file: Path, found: list[Diagnostic]) -> list[Document]:
    """Read the calibrations that the plant names; none if one is named twice."""
    named: dict[str, int] = {}
    for i, name in enumerate(plant.data.get("calibration", ())):
        first = named.setdefault(os.path.realpath(file.parent / name), i)
        if first != i:
            message, place = f"'{name}' is named twice", plant.place("calibration", i)
            second = plant.place("calibration", first)
            found.append(Diagnostic(place, "KB015", message, "name each file once", second))
            return []
    read = (_read_attached(plant, file, ("calibration", i), found) for i in named.values())
    return [document for document in read if document is not None]


def _read_adjacency(plant: Document, file: Path, found: list[Diagnostic]) -> tuple[str, str] | None:
    name = plant.data.get("adjacency")
    if name is None:
        return None
    place = plant.place("adjacency")
    if not _may_be_read(file, name, place, found):
        return None
    try:
        return name, begin_of(file.parent / name, MAX_FILE_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        found.append(Diagnostic(place, "KB003", f"'{name}' is not UTF-8", "save it as UTF-8"))
    except OSError as error:
        message = f"cannot read '{name}': {error.strerror or error}"
        found.append(Diagnostic(place, "KB001", message))
    return None
