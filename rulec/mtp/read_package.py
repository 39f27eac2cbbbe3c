"""Read the modules that the AutomationML files of one container describe."""

from collections.abc import Iterator
from pathlib import Path

from rulec.mtp import limits
from rulec.mtp.caex import Element, read_caex, read_members
from rulec.mtp.manifest import Manifest
from rulec.mtp.package import MtpRefused, Package
from rulec.mtp.space import Space


def read_packages(path: Path) -> list[Package]:
    """Modules of a .mtp, .zip or .aml file. Raises `MtpRefused`, and OSError for a missing file.

    All files of a container share one space of ids: a manifest may leave services and pictures to
    other files.
    """
    roots: list[Element] = []
    bases: dict[str, str] = {}
    left = limits.MOST_ELEMENTS
    for label, data in read_members(path):
        root, classes, count = read_caex(label, data, left)
        roots.append(root)
        bases |= classes
        left -= count
    space = Space(roots, bases)
    found = list({id(holder): holder for holder in _holders(space)}.values())
    if not found:
        raise MtpRefused(
            f"{path.name}: no list of instances in it, and so no tag; give the manifest of a "
            "module (a file with CommunicationSet and InstanceList)"
        )
    packages = []
    for holder in found:
        # One of several has what it refers to, a single one everything.
        referred = [
            space.find(text, one) for one in space.referring(holder) for text in one.texts.values()
        ]
        own = [holder, *(e for e in referred if e is not None)]
        parts = space.roots if len(found) == 1 else own
        packages.append(Manifest(space, holder, parts).package(path.name))
    return packages


def _holders(space: Space) -> Iterator[Element]:
    """The element of each module: a package, or the holder of a list of instances."""
    for element in (e for root in space.roots for e in root.inside()):
        if space.is_named(element, "InstanceList"):
            holder = element.parent or element
            while holder.parent is not None and holder.parent.tag == "InternalElement":
                if holder.get("RefBaseSystemUnitPath").endswith("ModuleTypePackage"):
                    break
                holder = holder.parent
            yield holder
