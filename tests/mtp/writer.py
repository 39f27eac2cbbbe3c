"""A small writer of Module Type Packages, and the example that ships with plant dosing-line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape, quoteattr

from tests.conftest import ROOT

EXAMPLE = ROOT / "plants" / "dosing-line" / "examples" / "dosing.aml"
NAMESPACE = "http://maker.example/dosing"
ENDPOINT = "opc.tcp://10.0.0.5:4840"
LIBRARY = "MTPDataObjectSUCLib/DataAssembly"
ROOT_OF_2_15 = '<CAEXFile FileName="Manifest.aml" SchemaVersion="2.15">'
ROOT_OF_3 = '<CAEXFile xmlns="http://www.dke.de/CAEX" SchemaVersion="3.0" FileName="Manifest.aml">'


@dataclass(frozen=True, kw_only=True)
class Point:
    """A tag: `bound` names attributes that nodes hold, `fixed` those with a text of their own."""

    name: str
    path: str = f"{LIBRARY}/IndicatorElement/AnaView"
    title: str = ""
    bound: Sequence[str] = ("V",)
    fixed: Mapping[str, str] = field(default_factory=dict)


def analog(
    name: str, title: str, unit: str, low: float, high: float, kind: str = "AnaView"
) -> Point:
    """A tag of a measured value with a fixed unit and range."""
    fixed = {"VUnit": unit, "VSclMin": f"{low:g}", "VSclMax": f"{high:g}"}
    path = f"{LIBRARY}/IndicatorElement/{kind}"
    return Point(name=name, path=path, title=title, fixed=fixed)


def attribute(name: str, value: str, kind: str = "xs:string") -> str:
    return (
        f"<Attribute Name={quoteattr(name)} AttributeDataType={quoteattr(kind)}>"
        f"<Value>{escape(value)}</Value></Attribute>"
    )


def element(name: str, key: str, path: str, *inside: str) -> str:
    head = f"Name={quoteattr(name)} ID={quoteattr(key)} RefBaseSystemUnitPath={quoteattr(path)}"
    return "\n".join([f"<InternalElement {head}>", *inside, "</InternalElement>"])


def item(key: str, name: str, namespace: str) -> str:
    """A node in the list of sources."""
    return (
        f"<ExternalInterface Name={quoteattr(name)} ID={quoteattr(key)} "
        'RefBaseClassPath="MTPCommunicationICLib/DataItem/OPCUAItem">'
        + attribute("Identifier", name)
        + attribute("Namespace", namespace)
        + attribute("Access", "1", "xs:unsignedByte")
        + "</ExternalInterface>"
    )


def instance(point: Point, number: int) -> str:
    bound = [attribute(a, f"item-{number}-{a}", "xs:IDREF") for a in point.bound]
    fixed = [attribute(name, text) for name, text in point.fixed.items()]
    own = [attribute("TagName", point.name), attribute("TagDescription", point.title)]
    link = attribute("RefID", f"ref-{number}", "xs:ID")
    return element(point.name, f"tag-{number}", point.path, *own, *bound, *fixed, link)


def manifest(
    points: Sequence[Point],
    *,
    name: str = "Dosing",
    namespace: str = NAMESPACE,
    endpoint: str = ENDPOINT,
    libraries: str = "",
) -> str:
    """The text of a manifest."""
    items = [
        item(f"item-{number}-{a}", f"{point.name}.{a}", namespace)
        for number, point in enumerate(points)
        for a in point.bound
    ]
    tags = [instance(point, number) for number, point in enumerate(points)]
    server = element(
        "OPCServer",
        "server",
        "MTPCommunicationSUCLib/ServerAssembly/OPCUAServer",
        attribute("Endpoint", endpoint),
        *items,
    )
    communication = element(
        "Communication",
        "communication",
        "MTPSUCLib/CommunicationSet",
        element("InstanceList", "instances", "MTPSUCLib/CommunicationSet/InstanceList", *tags),
        element("SourceList", "sources", "MTPSUCLib/CommunicationSet/SourceList", server),
    )
    package = element(name, "package", "MTPSUCLib/ModuleTypePackage", communication)
    return "\n".join(
        [
            '<?xml version="1.0" encoding="utf-8"?>',
            ROOT_OF_2_15,
            f'<InstanceHierarchy Name="H0" ID="hierarchy-0">\n{package}\n</InstanceHierarchy>',
            libraries,
            "</CAEXFile>\n",
        ]
    )


PRESSURE = analog("PI11", "Pressure behind the pump", "1137", 0, 10, "AnaMon")
FLOW = analog("FI12", "Flow to the mixer", "1353", 0, 250)


def example(version: str = "2.15") -> str:
    """The shipped dosing module with six tags, one service and a picture."""
    root = ROOT_OF_2_15 if version == "2.15" else ROOT_OF_3
    return EXAMPLE.read_text(encoding="utf-8").replace(ROOT_OF_2_15, root)
