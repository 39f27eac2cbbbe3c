"""Folders of knowledge in layers: the plant's own, named ones, packages, the shipped one.

The layers of a plant, in this order:

1. `kb/` beside its plant.yaml,
2. folders that `kb:` in its plant.yaml names,
3. folders in RULEC_KB, separated as in PATH,
4. installed packages with an entry point in the group ``rulec.kb``,
5. the nearest whole knowledge base upwards, else the shipped one.

All of them apply together. A folder whose units.yaml lists the unit "1" is a whole knowledge base,
as written by `rulec adopt`: the layers after it are left out.
"""

import importlib.metadata
import importlib.util
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from rulec_runtime.output.open_file import FOLDERS, begin_of, is_below, is_near

from rulec.language.diagnostics import Diagnostic, Place, Refused
from rulec.limits import MAX_FILE_BYTES

OWN, NAMED, VARIABLE, PACKAGE, UPWARDS, SHIPPED = (
    "own folder",
    "named in plant.yaml",
    "from RULEC_KB",
    "installed package",
    "in a folder above",
    "shipped with rulec",
)
"""Possible origins of a layer."""

KB, UNITS, PLANT = "kb", "units.yaml", "plant.yaml"
GROUP = "rulec.kb"
"""Entry points of packages: each names an importable package that holds YAML files."""

_OF_A_KIND = frozenset(("modules", "faults", "effects", "sensors", "fluids"))
_PLAIN_UNIT = re.compile(rb"""^\s+(["'])1\1\s*:""", re.MULTILINE)
_KNOWLEDGE = re.compile(rb"^(module|fault|effect|sensor|fluid|units):", re.MULTILINE)
_SOURCE_MAP = re.compile(rb"^(endpoint|servers|interval):", re.MULTILINE)
"""Keys of a map of signals to nodes or topics, which only a watch reads."""

_PACKAGE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Layer:
    """A folder of knowledge: its name in messages and rulesets, its origin, and its version.

    Only packages, which have that of their distribution, and the shipped one have a version.
    """

    name: str
    kind: str
    folder: Path
    version: str = ""

    @property
    def is_own(self) -> bool:
        """Whether it is the plant's own folder, or one that the plant or the user names."""
        return self.kind not in (PACKAGE, UPWARDS, SHIPPED)

    @cached_property
    def is_whole(self) -> bool:
        """Whether it lists the unit "1", which every knowledge base needs."""
        return has_line(self.folder / UNITS, _PLAIN_UNIT)

    @property
    def files(self) -> list[Path]:
        """Its YAML files, in order."""
        return yaml_files_in(self.folder)

    def inside(self, path: str) -> str:
        """Path of one of its files, relative to its folder."""
        relative = os.path.relpath(os.path.realpath(path), os.path.realpath(self.folder))
        return Path(relative).as_posix()


def layers_of(plant: Path, named: Sequence[tuple[str, Place]]) -> tuple[Layer, ...]:
    """Layers of the plant in a folder; `named` are the folders that its file names, with places.

    Raises `Refused` if a folder or a package is missing or holds no knowledge (KB001), or leads out
    of the plant's folder (KB016).
    """
    return _stack(_layers(plant, named))


def layers_around(near: Path, root: Path | None = None) -> tuple[Layer, ...]:
    """Layers that apply near a folder without a plant: `root`, and those of every plant.

    Raises `Refused` as `layers_of` does.
    """
    first = [] if root is None else [_folder(root, OWN)]
    return _stack([*first, *_ambient(near)])


def root_of(file: Path) -> Path | None:
    """The folder of knowledge that a file belongs to; None if it belongs to none.

    A knowledge base may hold copies of others in folders of their own, as `rulec adopt` writes.
    """
    folder = Path(os.path.abspath(file)).parent  # of a link itself, not of its target
    nearest = None
    for part in (folder, *folder.parents):
        if part.name == KB:
            return part
        if (part / PLANT).is_file():
            break
        if nearest is None and (part / UNITS).is_file():
            nearest = part
        elif nearest is None and part.name in _OF_A_KIND:
            nearest = part.parent
    return nearest


def yaml_files_in(folder: Path) -> list[Path]:
    """YAML files of a folder, without those in hidden folders, and without source maps."""
    files = (f for f in folder.rglob("*") if f.suffix in (".yaml", ".yml") and f.is_file())
    shown = (f for f in files if not any(p[0] == "." for p in f.relative_to(folder).parts))
    return sorted(f for f in shown if not has_line(f, _SOURCE_MAP))


def shipped(name: str) -> Path:
    """A folder shipped with the tool, in a checkout or in an installed package."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def plant_file(plant: Path) -> Path:
    """The file of a plant that is given as a folder or as the file itself."""
    return plant / PLANT if plant.is_dir() else plant


def _stack(layers: Iterable[Layer]) -> tuple[Layer, ...]:
    """Each folder once, down to the first whole knowledge base."""
    result: list[Layer] = []
    seen: set[str] = set()
    for layer in layers:
        real = os.path.realpath(layer.folder)
        if real in seen:
            continue
        seen.add(real)
        result.append(layer)
        if layer.is_whole:
            break
    return tuple(result)


def _layers(plant: Path, named: Sequence[tuple[str, Place]]) -> Iterator[Layer]:
    if (plant / KB).is_dir():
        if not is_near(plant / KB, plant):
            raise Refused([leads_out(Place((plant / KB).as_posix()))])
        yield _folder(plant / KB, OWN)
    for text, place in named:
        if not is_near(plant / text, plant) and not is_below(plant / text, shipped(KB)):
            raise Refused([leads_out(place, text)])
        yield _existing(plant / text, text, place, NAMED)
    yield from _ambient(plant)


def _ambient(near: Path) -> Iterator[Layer]:
    """Layers of every plant: from the variable, from packages, and the lowest one."""
    for text in filter(None, os.environ.get("RULEC_KB", "").split(os.pathsep)):
        yield _existing(Path(text), text, Place("RULEC_KB"), VARIABLE)
    yield from _packages()
    above = (near.resolve(), *near.resolve().parents)
    layers = (Layer(KB, UPWARDS, place) for folder in above for place in (folder / KB, folder))
    found = next((layer for layer in layers if layer.is_whole), None)
    if found is None or found.folder == shipped(KB):
        found = Layer(KB, SHIPPED, shipped(KB), version_of_rulec())
    yield found


def _folder(folder: Path, kind: str) -> Layer:
    """A layer without a version, named by the last two parts of its path."""
    return Layer("/".join(folder.resolve().parts[-2:]), kind, folder)


def leads_out(place: Place, name: str = "") -> Diagnostic:
    """A name in a file, or else a link, leads to a folder that may not be read."""
    message = f"'{name}' leads out of the folder of this file" if name else "this link leads out"
    hint = f"it may lead to a folder beside its own at most; {FOLDERS} names further ones"
    return Diagnostic(place, "KB016", message, hint)


def _existing(folder: Path, text: str, place: Place, kind: str) -> Layer:
    if not os.path.isdir(folder) or not _has_knowledge(folder):
        message = f"there is no knowledge in '{text}'"
        seen_from = "this file" if kind == NAMED else "the working folder"
        hint = f"a folder with YAML files of module types and the like, as seen from {seen_from}"
        raise Refused([Diagnostic(place, "KB001", message, hint)])
    return _folder(folder, kind)


def _has_knowledge(folder: Path) -> bool:
    """Whether a file seems to describe something, judged without parsing it."""
    return any(has_line(file, _KNOWLEDGE) for file in yaml_files_in(folder))


def has_line(file: Path, key: re.Pattern[bytes]) -> bool:
    """Whether a file has a key, without parsing it; False if it cannot be read."""
    try:
        return key.search(begin_of(file, MAX_FILE_BYTES)) is not None
    except OSError:
        return False


def _packages() -> Iterator[Layer]:
    """Installed packages in order of their names; their code is not run."""
    points = importlib.metadata.entry_points(group=GROUP)
    for point in sorted(points, key=lambda p: (p.dist.name if p.dist else "", p.name, p.value)):
        name = point.dist.name if point.dist else point.name
        folder = _folder_of(point.value)
        if folder is None or not _has_knowledge(folder):
            message = f"there is no knowledge in '{point.value}' of the package '{name}'"
            hint = f"install it again, or remove it: pip uninstall {name}"
            raise Refused([Diagnostic(Place(name), "KB001", message, hint)])
        yield Layer(name, PACKAGE, folder, point.dist.version if point.dist else "")


def _folder_of(module: str) -> Path | None:
    """Folder of a package such as ``acme.pumps``, without importing it; None if there is none."""
    top, *rest = module.split(".")
    try:
        found = importlib.util.find_spec(top)
    except (ImportError, ValueError):
        return None
    places = found.submodule_search_locations if found else None
    folders = (Path(place).joinpath(*rest) for place in places or ())
    return next((folder for folder in folders if folder.is_dir()), None)


def version_of_rulec() -> str:
    """Version of the installed distribution; empty if it is not installed."""
    try:
        return importlib.metadata.version("rulec")
    except importlib.metadata.PackageNotFoundError:
        return ""
