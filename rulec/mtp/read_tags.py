"""Read what a manifest lists: sources, tags and services.

Sources are servers and nodes; attributes of tags are fixed or bound to nodes; services have
procedures (strategies in older files).
"""

import re
from base64 import b64decode
from collections.abc import Iterator, Mapping, Sequence
from uuid import UUID

from rulec.mtp import limits
from rulec.mtp.caex import Element
from rulec.mtp.package import Attribute, Node, Oddity, Parameter, Procedure, Server, Service, Tag
from rulec.mtp.space import Space, checked

_NAMES = ("TagName", "tag_name")
_TITLES = ("TagDescription", "tag_description")
_NUMBER = re.compile(r"[-+]?[\d.,]+([eE][-+]?\d+)?")
_ID = re.compile(r"\{?(?=.*\d)[\w-]+\}?")
"""The form of an id; makers declare fixed words as references too."""


def read_tags(
    space: Space, package: Element, items: Mapping[int, Node | None], odd: list[Oddity]
) -> Iterator[Tag]:
    """Tags of a module, in the order of the file. Raises `MtpRefused` for invalid names."""
    for group in package.inside():
        if space.is_named(group, "InstanceList"):
            for element in _leaves(group):
                yield _tag(space, element, items, odd)


def _leaves(group: Element) -> Iterator[Element]:
    """Elements of a list and of its groups; a group has no attributes of its own."""
    for element in group.of("InternalElement"):
        if any(element.of("InternalElement")) and not any(element.of("Attribute")):
            yield from _leaves(element)
        else:
            yield element


def _tag(
    space: Space, element: Element, items: Mapping[int, Node | None], odd: list[Oddity]
) -> Tag:
    texts = {a.get("Name"): a.texts.get("Value", "") for a in element.of("Attribute")}
    name, place = space.name(element), element.place
    given = checked(next((texts[k] for k in _NAMES if texts.get(k)), ""), "a tag name", place)
    title = next((texts[k] for k in _TITLES if texts.get(k)), "")
    attributes = {
        a.get("Name"): _attribute(space, element, a, items, odd)
        for a in element.of("Attribute")
        if a.get("Name") not in (*_NAMES, *_TITLES, "RefID")
    }
    kind = space.kind(element)
    path = next(space.paths(element), "")
    if not kind:
        text = f"'{name or given}' is of the class '{path[:80]}'"
        remedy = "it is listed without a signal; write one yourself if it measures something"
        odd.append(Oddity("tags of an unknown class", place, text, remedy))
    return Tag(
        name=name or given,
        given=given,
        title=" ".join((title or element.texts.get("Description", "")).split()),
        kind=kind,
        path=path,
        reference=texts.get("RefID", "").lower(),
        attributes=attributes,
        place=place,
    )


def _attribute(
    space: Space,
    tag: Element,
    element: Element,
    items: Mapping[int, Node | None],
    odd: list[Oddity],
) -> Attribute:
    text = element.texts.get("Value", "")
    default = element.texts.get("DefaultValue", "")
    target = space.find(text, element) if text else None
    node = items.get(id(target)) if target is not None else None
    wants = element.get("AttributeDataType").rpartition(":")[2].upper() == "IDREF"
    literal = _NUMBER.fullmatch(text) is not None or _ID.fullmatch(text) is None
    linked = target is not None and id(target) in items
    dangling = node is None and (linked or (wants and not literal))
    if dangling and not linked:
        name = f"{space.name(tag)}.{element.get('Name')}"
        what = f"{name} refers to '{text[:60]}', which is not there"
        remedy = "export again, or look the node up in the server"
        odd.append(Oddity("references that lead nowhere", element.place, what, remedy))
    fixed = node is None and not dangling
    return Attribute(
        text=text if fixed else "",
        default=default if not fixed or not text else "",
        node=node,
        dangling=dangling,
        place=element.place,
    )


_TRUE = ("true", "1")


def read_services(
    space: Space, parts: Sequence[Element], tags: Sequence[Tag], odd: list[Oddity]
) -> Iterator[Service]:
    """Services in the order of the files."""
    by_reference = {tag.reference: tag for tag in tags if tag.reference}
    for part in parts:
        for element in part.inside():
            if space.is_a(element, "Service"):
                yield _service(space, element, by_reference, odd)


def _service(space: Space, element: Element, tags: Mapping[str, Tag], odd: list[Oddity]) -> Service:
    inside = list(element.inside())
    parameters = {
        id(e): _parameter(space, e, tags, odd)
        for e in inside
        if space.passes(e, "ServiceParameter")
    }
    by_id = {e.get("ID").lower(): parameters[id(e)] for e in inside if id(e) in parameters}
    procedures = [e for e in inside if space.is_a(e, "ServiceProcedure", "ServiceStrategy")]
    return Service(
        name=space.name(element),
        procedures=tuple(_procedure(space, e, parameters, by_id) for e in procedures),
        parameters=tuple(parameters.values()),
    )


def _procedure(
    space: Space,
    element: Element,
    parameters: Mapping[int, Parameter],
    by_id: Mapping[str, Parameter],
) -> Procedure:
    texts = element.values()
    own = [parameters[id(e)] for e in element.walk() if id(e) in parameters]
    asked = texts.get("requiredparameters", "").lower().split()[: limits.MOST_LISTED]
    return Procedure(
        name=space.name(element),
        number=texts.get("procedureid") or texts.get("strategyid", ""),
        default=texts.get("isdefault", "").lower() in _TRUE,
        completes=texts.get("isselfcompleting", "").lower() in _TRUE,
        parameters=(*own, *(by_id[key] for key in asked if key in by_id)),
    )


def _parameter(
    space: Space, element: Element, tags: Mapping[str, Tag], odd: list[Oddity]
) -> Parameter:
    texts = {a.get("Name"): a.texts.get("Value", "") for a in element.of("Attribute")}
    tag = tags.get(texts.get("RefID", "").lower())
    if tag is None:
        text = f"no tag belongs to the parameter '{space.name(element)}'"
        remedy = "its unit and its node are not known; look them up in the server"
        odd.append(Oddity("service parameters without tag", element.place, text, remedy))
    path = next(space.paths(element), "")
    return Parameter(name=space.name(element), kind=path.rpartition("/")[2], tag=tag)


_ACCESS = {"1": "read", "2": "write", "3": "read and write"}
_WHOLE = re.compile(r"(nsu=[^;]+;|ns=\d+;)?([isgb])=(.+)", re.DOTALL)
_KINDS = {"byte": "i", "short": "i", "int": "i", "long": "i", "integer": "i"} | {
    "id": "g",
    "base64binary": "b",
}
"""Kind of node id by the end of the data type of an identifier: `xs:ID` is a GUID."""


def read_servers(space: Space, package: Element, odd: list[Oddity]) -> Iterator[Server]:
    """Servers of a module with their endpoints; an endpoint is empty if the file gives none."""
    for element in package.inside():
        if element.attribute("Endpoint") is not None or space.is_a(element, "OPCUAServer"):
            endpoint = checked(_value(element, "Endpoint"), "an endpoint", element.place)
            if not endpoint.startswith("opc.tcp://"):
                text = f"server '{space.name(element)}' has the endpoint '{endpoint}'"
                remedy = "write 'endpoint: opc.tcp://HOST:4840' into the map"
                odd.append(Oddity("servers without endpoint", element.place, text, remedy))
                endpoint = ""
            yield Server(name=space.name(element), endpoint=endpoint)


def read_items(space: Space, package: Element, odd: list[Oddity]) -> Mapping[int, Node | None]:
    """The node of each item of a list of sources by the identity of its element; None if the item
    does not identify one."""
    found: dict[int, Node | None] = {}
    for element in package.walk():
        if element.tag in ("ExternalInterface", "InternalElement") and is_item(space, element):
            server = space.name(element.parent) if element.parent is not None else ""
            found[id(element)] = _node(space, element, server, odd)
    return found


def is_item(space: Space, element: Element) -> bool:
    """Whether an element stands for a node."""
    return element.attribute("Identifier") is not None or space.is_a(element, "OPCUAItem")


def _node(space: Space, element: Element, server: str, odd: list[Oddity]) -> Node | None:
    identifier = checked(_value(element, "Identifier"), "an identifier", element.place)
    namespace = checked(_value(element, "Namespace"), "a namespace", element.place)
    try:
        attribute = element.attribute("Identifier")
        data_type = attribute.get("AttributeDataType") if attribute else ""
        found = node_id(identifier, namespace, data_type)
    except ValueError as error:
        text = f"the item '{space.name(element)}' has {error}"
        remedy = "look the node up in the server, and write its id into the map"
        odd.append(Oddity("items without node", element.place, text, remedy))
        return None
    access = _value(element, "Access").strip()
    return Node(id=found, access=_ACCESS.get(access, access.lower()), server=server)


def node_id(identifier: str, namespace: str, data_type: str = "") -> str:
    """A node id as a source map writes it; a namespace is a URI, or a number in older files.

    Raises ValueError that says what is wrong with the identifier.

    >>> node_id("A.dp", "http://maker/pump"), node_id("A.dp", "4"), node_id("ns=3;s=A.dp", "3")
    ('nsu=http://maker/pump;s=A.dp', 'ns=4;s=A.dp', 'ns=3;s=A.dp')
    >>> node_id("17", "4", "xs:unsignedInt"), node_id("i=17", "")
    ('ns=4;i=17', 'i=17')
    >>> node_id("{72962B91-FA75-4AE6-8D28-B404DC7DAF63}", "4", "xs:ID")
    'ns=4;g=72962b91-fa75-4ae6-8d28-b404dc7daf63'
    >>> node_id("M/RbKBsRVkePCePcx24oRA==", "4", "xs:base64Binary")
    'ns=4;b=M/RbKBsRVkePCePcx24oRA=='
    """
    if not identifier:
        raise ValueError("no identifier")
    whole = _WHOLE.fullmatch(identifier)
    if whole:
        own, kind, value = whole.groups()
    else:
        kinds = (kind for end, kind in _KINDS.items() if data_type.lower().endswith(end))
        own, kind, value = None, next(kinds, "s"), identifier
    try:
        value = _valid(kind, value)
    except ValueError:
        what = {"i": "a whole number of 32 bits", "g": "a GUID", "b": "base64"}[kind]
        what_type = f" of type {data_type}" if not whole else ""
        raise ValueError(f"the identifier '{identifier}'{what_type}, which is not {what}") from None
    if own is None and namespace:
        own = f"{'ns' if namespace.isdigit() else 'nsu'}={namespace};"
    return f"{own or ''}{kind}={value}"


def _valid(kind: str, value: str) -> str:
    """The value of a node id in its usual form. Raises ValueError if it does not fit its kind."""
    if kind == "i" and not (value.isdecimal() and int(value) < 1 << 32):
        raise ValueError
    if kind == "g":
        return str(UUID(value))
    if kind == "b":
        value = value.replace(" ", "")
        b64decode(value, validate=True)
    return value


def _value(element: Element, name: str) -> str:
    found = element.attribute(name)
    return (found.texts.get("Value") or found.texts.get("DefaultValue", "")) if found else ""
