"""Read the list of instances: tags whose attributes are fixed or bound to nodes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from rulec.mtp.caex import Element
from rulec.mtp.package import Attribute, Node, Tag
from rulec.mtp.refused import Oddity
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
