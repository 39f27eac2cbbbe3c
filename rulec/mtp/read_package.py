"""Read the modules that the AutomationML files of one container describe."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from rulec.mtp import limits
from rulec.mtp.caex import Caex, Element, read_caex, read_members
from rulec.mtp.package import MtpRefused, Oddity, Package, Server
from rulec.mtp.read_pictures import read_pictures
from rulec.mtp.read_tags import is_item, read_items, read_servers, read_services, read_tags
from rulec.mtp.space import Space


def read_packages(path: Path) -> list[Package]:
    """Modules of a .mtp, .zip or .aml file. Raises `MtpRefused`, and OSError for a missing file.

    All files of a container share one space of ids: a manifest may leave services and pictures to
    other files.
    """
    files: list[Caex] = []
    for member in read_members(path):
        files.append(read_caex(member, limits.MOST_ELEMENTS - sum(file.elements for file in files)))
    space = Space([file.root for file in files], {k: v for f in files for k, v in f.bases.items()})
    found = list(_packages(space))
    if not found:
        raise MtpRefused(
            f"{path.name}: no list of instances in it, and so no tag; give the manifest of a "
            "module (a file with CommunicationSet and InstanceList)"
        )
    whole = space.roots if len(found) == 1 else None
    return [_package(path, space, element, whole or _parts(space, element)) for element in found]


def _packages(space: Space) -> Iterator[Element]:
    """The element of each module: a package, or the holder of a list of instances."""
    found: set[int] = set()
    for element in (e for root in space.roots for e in root.inside()):
        if not space.is_named(element, "InstanceList"):
            continue
        holder = element.parent or element
        while holder.parent is not None and holder.parent.tag == "InternalElement":
            if holder.get("RefBaseSystemUnitPath").endswith("ModuleTypePackage"):
                break
            holder = holder.parent
        if id(holder) not in found:
            found.add(id(holder))
            yield holder


def _parts(space: Space, package: Element) -> list[Element]:
    """A package of a container with several, and what it refers to."""
    referred = [
        space.find(text, element)
        for element in package.walk()
        if element.tag == "Attribute" and element.get("Name").lower() == "refuri"
        for text in element.texts.values()
    ]
    return [package, *(e for e in referred if e is not None)]


def _package(path: Path, space: Space, element: Element, parts: Sequence[Element]) -> Package:
    odd = list(_twice(space))
    servers = tuple(read_servers(space, element, odd))
    items = read_items(space, element, odd)
    odd += _missing(space, element)
    if not items:
        remedy = "write node ids into the map, or export the module with its server"
        odd.append(Oddity("no nodes", element.place, "the list of sources holds no node", remedy))
    tags = tuple(read_tags(space, element, items, odd))
    if not tags:
        raise MtpRefused(
            f"{element.place}: the list of instances is empty; export the module with its tags"
        )
    if len(tags) > limits.MOST_TAGS:
        raise MtpRefused(
            f"{element.place}: {len(tags)} tags, more than {limits.MOST_TAGS}; is it one module?"
            " Export each alone"
        )
    symbols, connections = read_pictures(space, parts)
    version = element.attribute("Version")
    headers = (e.texts for root in space.roots for e in root.walk() if e.tag == "WriterHeader")
    writer: Mapping[str, str] = next(headers, {})
    return Package(
        file=path.name,
        name=space.name(element),
        title=element.texts.get("Description", ""),
        version=element.texts.get("Version") or (version.texts.get("Value", "") if version else ""),
        writer=writer.get("WriterVendor") or writer.get("WriterName", ""),
        tags=tags,
        servers=servers or (Server(name="", endpoint=""),),
        services=tuple(read_services(space, parts, tags, odd)),
        symbols=symbols,
        connections=connections,
        odd=tuple(odd),
    )


def _missing(space: Space, package: Element) -> Iterator[Oddity]:
    """Missing files or elements, of services or pictures, that a manifest refers to."""
    files = [root.place.rpartition(":")[0] for root in space.roots]
    for element in package.walk():
        if element.tag != "Attribute" or element.get("Name").lower() != "refuri":
            continue
        text = element.texts.get("Value", "")
        path = text.replace("\\", "/").lstrip("/")
        if text and space.find(text, element) is None and not any(f.endswith(path) for f in files):
            what = f"it refers to '{text[:80]}', which is not there"
            remedy = "give the whole container; without it services or pictures are lacking"
            yield Oddity("parts that are missing", element.place, what, remedy)


def _twice(space: Space) -> Iterator[Oddity]:
    """Ids that occur twice in a file. Raises `MtpRefused` if one belongs to a node: a reading might
    silently come from another place."""
    for key, elements in space.twice():
        text = f"the id '{key[:60]}' stands at {elements[0].place} already"
        if any(is_item(space, element) for element in elements):
            raise MtpRefused(
                f"{elements[1].place}: {text}, and which node is meant is open; export the module "
                "again with an id of its own for each item"
            )
        remedy = "what refers to it is left out; give each element an id of its own"
        yield Oddity("ids that stand twice", elements[1].place, text, remedy)
