"""Read what a manifest lists: sources, tags and services.

Sources are servers and nodes; attributes of tags are fixed or bound to nodes; services have
procedures (strategies in older files).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rulec.mtp import limits
from rulec.mtp.caex import Element
from rulec.mtp.node_id import node_id
from rulec.mtp.package import (
    Attribute,
    MtpRefused,
    Node,
    Oddity,
    Package,
    Server,
    Tag,
)
from rulec.mtp.read_pictures import read_pictures
from rulec.mtp.space import Space, checked

_NAMES = ("tagname", "tag_name")
_TITLES = ("tagdescription", "tag_description")
_NUMBER = re.compile(r"[-+]?[\d.,]+([eE][-+]?\d+)?")
_ID = re.compile(r"\{?(?=.*\d)[\w-]+\}?")
"""The form of an id; makers declare fixed words as references too."""

_TRUE = ("true", "1")
_ACCESS = {"1": "read", "2": "write", "3": "read and write"}


class Manifest:
    """A module: its `element`, and the `parts` of its container that hold services and pictures."""

    def __init__(self, space: Space, element: Element, parts: Sequence[Element]) -> None:
        self._space, self._element, self._parts = space, element, parts
        self._odd: list[Oddity] = []
        self._items: dict[int, Node | None] = {}
        """Nodes by the identity of their items; None for an item that does not identify one."""

    def package(self, file: str) -> Package:
        """All that is read of the module. Raises `MtpRefused` if it has no tags, or too many."""
        space, element = self._space, self._element
        self._check_ids()
        servers = tuple(self._servers())
        for one in element.walk():
            if one.tag in ("ExternalInterface", "InternalElement") and _is_item(space, one):
                self._items[id(one)] = self._node(one)
        self._check_parts()
        if not self._items:
            remedy = "write node ids into the map, or export the module with its server"
            self._report("no nodes", element.place, "the list of sources holds no node", remedy)
        lists = (group for group in element.inside() if space.is_named(group, "InstanceList"))
        tags = tuple(self._tag(one) for group in lists for one in _leaves(group))
        if not tags:
            raise MtpRefused(
                f"{element.place}: the list of instances is empty; export the module with its tags"
            )
        if len(tags) > limits.MOST_TAGS:
            raise MtpRefused(
                f"{element.place}: {len(tags)} tags, more than {limits.MOST_TAGS}; is it one "
                "module? Export each alone"
            )
        by_reference = {tag.reference: tag for tag in tags if tag.reference}
        inside = (e for part in self._parts for e in part.inside() if space.is_a(e, "Service"))
        services = tuple(self._service(one, by_reference) for one in inside)
        symbols, connections = read_pictures(space, self._parts)
        headers = (e.texts for root in space.roots for e in root.walk() if e.tag == "WriterHeader")
        writer: Mapping[str, str] = next(headers, {})
        return Package(
            file=file,
            name=space.name(element),
            title=element.texts.get("Description", ""),
            version=element.texts.get("Version") or element.text("Version"),
            writer=writer.get("WriterVendor") or writer.get("WriterName", ""),
            tags=tags,
            servers=servers or (Server(name="", endpoint=""),),
            services=services,
            symbols=symbols,
            connections=connections,
            odd=tuple(self._odd),
        )

    def _report(self, kind: str, place: str, text: str, remedy: str) -> None:
        self._odd.append(Oddity(kind, place, text, remedy))

    def _check_ids(self) -> None:
        """Report ids that occur twice in a file; refuse those of nodes, as a reading might silently
        come from another place."""
        for key, elements in self._space.twice():
            text = f"the id '{key[:60]}' stands at {elements[0].place} already"
            if any(_is_item(self._space, element) for element in elements):
                raise MtpRefused(
                    f"{elements[1].place}: {text}, and which node is meant is open; export the "
                    "module again with an id of its own for each item"
                )
            remedy = "what refers to it is left out; give each element an id of its own"
            self._report("ids that stand twice", elements[1].place, text, remedy)

    def _check_parts(self) -> None:
        """Report files or elements, of services or pictures, that are referred to and missing."""
        files = [root.place.rpartition(":")[0] for root in self._space.roots]
        for element in self._space.referring(self._element):
            text = element.texts.get("Value", "")
            path = text.replace("\\", "/").lstrip("/")
            here = any(file.endswith(path) for file in files)
            if text and not here and self._space.find(text, element) is None:
                what = f"it refers to '{text[:80]}', which is not there"
                remedy = "give the whole container; without it services or pictures are lacking"
                self._report("parts that are missing", element.place, what, remedy)

    def _servers(self) -> Iterator[Server]:
        """Servers with their endpoints; an endpoint is empty if the file gives none."""
        for one in self._element.inside():
            if one.attribute("Endpoint") is not None or self._space.is_a(one, "OPCUAServer"):
                name = self._space.name(one)
                endpoint = checked(one.text("Endpoint", True), "an endpoint", one.place)
                if not endpoint.startswith("opc.tcp://"):
                    text = f"server '{name}' has the endpoint '{endpoint}'"
                    remedy = "write 'endpoint: opc.tcp://HOST:4840' into the map"
                    self._report("servers without endpoint", one.place, text, remedy)
                    endpoint = ""
                yield Server(name=name, endpoint=endpoint)

    def _node(self, item: Element) -> Node | None:
        server = self._space.name(item.parent) if item.parent is not None else ""
        identifier = checked(item.text("Identifier", True), "an identifier", item.place)
        namespace = checked(item.text("Namespace", True), "a namespace", item.place)
        attribute = item.attribute("Identifier")
        try:
            data_type = attribute.get("AttributeDataType") if attribute else ""
            found = node_id(identifier, namespace, data_type)
        except ValueError as error:
            text = f"the item '{self._space.name(item)}' has {error}"
            remedy = "look the node up in the server, and write its id into the map"
            self._report("items without node", item.place, text, remedy)
            return None
        access = item.text("Access", True).strip()
        return Node(id=found, access=_ACCESS.get(access, access.lower()), server=server)

    def _tag(self, element: Element) -> Tag:
        texts, name, place = element.values(), self._space.name(element), element.place
        given = checked(next((texts[k] for k in _NAMES if texts.get(k)), ""), "a tag name", place)
        title = next((texts[k] for k in _TITLES if texts.get(k)), "")
        attributes = {
            a.get("Name"): self._attribute(name, a)
            for a in element.of("Attribute")
            if a.get("Name").lower() not in (*_NAMES, *_TITLES, "refid")
        }
        kind, path = self._space.kind(element), next(self._space.paths(element), "")
        if not kind:
            text = f"'{name or given}' is of the class '{path[:80]}'"
            remedy = "it is listed without a signal; write one yourself if it measures something"
            self._report("tags of an unknown class", place, text, remedy)
        return Tag(
            name=name or given,
            given=given,
            title=" ".join((title or element.texts.get("Description", "")).split()),
            kind=kind,
            path=path,
            reference=texts.get("refid", "").lower(),
            attributes=attributes,
            place=place,
        )

    def _attribute(self, tag: str, element: Element) -> Attribute:
        text = element.texts.get("Value", "")
        default = element.texts.get("DefaultValue", "")
        target = self._space.find(text, element) if text else None
        linked = target is not None and id(target) in self._items
        node = self._items.get(id(target)) if target is not None else None
        wants = element.get("AttributeDataType").rpartition(":")[2].upper() == "IDREF"
        literal = _NUMBER.fullmatch(text) is not None or _ID.fullmatch(text) is None
        dangling = node is None and (linked or (wants and not literal))
        if dangling and not linked:
            what = f"{tag}.{element.get('Name')} refers to '{text[:60]}', which is not there"
            remedy = "export again, or look the node up in the server"
            self._report("references that lead nowhere", element.place, what, remedy)
        fixed = node is None and not dangling
        return Attribute(
            text=text if fixed else "",
            default=default if not fixed or not text else "",
            node=node,
            dangling=dangling,
            place=element.place,
        )

    def _service(self, element: Element, tags: Mapping[str, Tag]) -> dict[str, Any]:
        """A service in JSON form, with its procedures and the parameters that these ask for."""
        space = self._space
        inside = [e for e in element.inside() if space.passes(e, "ServiceParameter")]
        parameters = {id(e): self._parameter(e, tags) for e in inside}
        names = {e.get("ID").lower(): space.name(e) for e in inside}
        procedures = []
        for one in element.inside():
            if space.is_a(one, "ServiceProcedure", "ServiceStrategy"):
                texts = one.values()
                own = [space.name(e) for e in one.walk() if id(e) in parameters]
                asked = texts.get("requiredparameters", "").lower().split()[: limits.MOST_LISTED]
                procedure = {
                    "name": space.name(one),
                    "number": texts.get("procedureid") or texts.get("strategyid", ""),
                    "default": texts.get("isdefault", "").lower() in _TRUE,
                    "completes": texts.get("isselfcompleting", "").lower() in _TRUE,
                    "parameters": [*own, *(names[key] for key in asked if key in names)],
                }
                procedures.append(procedure)
        return {
            "name": space.name(element),
            "procedures": procedures,
            "parameters": list(parameters.values()),
        }

    def _parameter(self, element: Element, tags: Mapping[str, Tag]) -> dict[str, Any]:
        """A parameter or report value of a service, with the name of the tag behind it."""
        name, tag = self._space.name(element), tags.get(element.values().get("refid", "").lower())
        if tag is None:
            text = f"no tag belongs to the parameter '{name}'"
            remedy = "its unit and its node are not known; look them up in the server"
            self._report("service parameters without tag", element.place, text, remedy)
        kind = next(self._space.paths(element), "").rpartition("/")[2]
        return {"name": name, "kind": kind, "tag": tag.name if tag else None}


def _leaves(group: Element) -> Iterator[Element]:
    """Elements of a list and of its groups; a group has no attributes of its own."""
    for element in group.of("InternalElement"):
        if any(element.of("InternalElement")) and not any(element.of("Attribute")):
            yield from _leaves(element)
        else:
            yield element


def _is_item(space: Space, element: Element) -> bool:
    """Whether an element stands for a node."""
    return element.attribute("Identifier") is not None or space.is_a(element, "OPCUAItem")
