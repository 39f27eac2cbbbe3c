"""Read services of a module: procedures (strategies in older files) and parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rulec.mtp import limits
from rulec.mtp.caex import Element
from rulec.mtp.package import Parameter, Procedure, Service, Tag
from rulec.mtp.refused import Oddity
from rulec.mtp.space import Space

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
