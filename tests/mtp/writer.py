"""A small writer of Module Type Packages, in CAEX 2.15 and 3.0, with the habits of several makers.

``python -m tests.mtp.writer`` writes the example that ships with plant dosing-line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape, quoteattr

from tests.conftest import ROOT

EXAMPLE = ROOT / "plants" / "dosing-line" / "examples" / "dosing.aml"
NAMESPACE = "http://maker.example/dosing"
ENDPOINT = "opc.tcp://10.0.0.5:4840"
LIBRARY = "MTPDataObjectSUCLib/DataAssembly"
ROOTS = {
    "2.15": '<CAEXFile FileName="Manifest.aml" SchemaVersion="2.15">',
    "3.0": '<CAEXFile xmlns="http://www.dke.de/CAEX" SchemaVersion="3.0" FileName="Manifest.aml">',
}


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


def pipe(number: int, ends: Sequence[str]) -> str:
    """A pipe whose nozzles are linked to ports of symbols."""
    nozzles = [
        element(f"Nozzle{i}", f"nozzle-{number}-{i}", "MTPHMISUCLib/PortObject/Nozzle")
        for i in range(len(ends))
    ]
    return element(f"Pipe_{number}", f"pipe-{number}", "MTPHMISUCLib/Connection/Pipe", *nozzles)


def picture(symbols: Mapping[str, str], pipes: Sequence[Sequence[str]]) -> str:
    """Symbols with their ECLASS codes, and pipes between them."""
    drawn = [
        element(
            name,
            f"symbol-{name}",
            "MTPHMISUCLib/VisualObject",
            attribute("eClassClassificationClass", code),
            element("Nozzle1", f"port-{name}", "MTPHMISUCLib/PortObject/Nozzle"),
        )
        for name, code in symbols.items()
    ]
    links = [
        f'<InternalLink Name="L" RefPartnerSideA="nozzle-{n}-{i}:Connector" '
        f'RefPartnerSideB="port-{end}:Connector"/>'
        for n, ends in enumerate(pipes)
        for i, end in enumerate(ends)
    ]
    lines = [pipe(n, ends) for n, ends in enumerate(pipes)]
    return element("Overview", "picture", "MTPHMISUCLib/Picture", *drawn, *lines, *links)


def service(name: str, procedure: str, parameter: str, tag: int) -> str:
    """A service with one procedure and one parameter, whose tag has the given number."""
    inner = element(
        parameter,
        f"parameter-{name}",
        "MTPServiceSUCLib/ServiceParameter/ProcedureParameter",
        attribute("RefID", f"ref-{tag}", "xs:ID"),
    )
    steps = element(
        procedure,
        f"procedure-{name}",
        "MTPServiceSUCLib/ServiceProcedure",
        attribute("ProcedureID", "1"),
        attribute("IsDefault", "true"),
        attribute("IsSelfCompleting", "false"),
        inner,
    )
    return element(name, f"service-{name}", "MTPServiceSUCLib/Service", steps)


def manifest(
    points: Sequence[Point],
    *,
    version: str = "2.15",
    name: str = "Dosing",
    namespace: str = NAMESPACE,
    endpoint: str = ENDPOINT,
    services: Sequence[str] = (),
    pictures: Sequence[str] = (),
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
    hierarchies = [package, *pictures, *services]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="utf-8"?>',
            ROOTS[version],
            *(
                f'<InstanceHierarchy Name="H{i}" ID="hierarchy-{i}">\n{part}\n</InstanceHierarchy>'
                for i, part in enumerate(hierarchies)
            ),
            libraries,
            "</CAEXFile>\n",
        ]
    )


DRIVE = Point(
    name="PU01",
    path=f"{LIBRARY}/ActiveElement/AnaDrv",
    title="Dosing pump",
    bound=("Rpm", "RpmFbk"),
    fixed={"RpmUnit": "1085", "RpmSclMin": "0", "RpmSclMax": "1500"},
)
PRESSURE = analog("PI11", "Pressure behind the pump", "1137", 0, 10, "AnaMon")
FLOW = analog("FI12", "Flow to the mixer", "1353", 0, 250)
LEVEL = analog("LI13", "Storage tank", "1013", 0, 800)
LACKING = Point(name="TI14", title="Temperature of the motor", bound=("V", "VUnit"))
SET_POINT = Point(
    name="Dose.Flow",
    path=f"{LIBRARY}/OperationElement/AnaServParam",
    title="Set point",
    bound=("VOut",),
    fixed={"VUnit": "1353", "VSclMin": "0", "VSclMax": "250"},
)
POINTS = (DRIVE, PRESSURE, FLOW, LEVEL, LACKING, SET_POINT)
PICTURE = picture(
    {"Tank": "36030000", "PU01": "36410000", "Outlet": "-"}, (("Tank", "PU01"), ("PU01", "Outlet"))
)


def example(version: str = "2.15") -> str:
    """A dosing module with six tags, one service and a picture."""
    services = (service("Dose", "continuous", "Flow", POINTS.index(SET_POINT)),)
    return manifest(POINTS, version=version, services=services, pictures=(PICTURE,))


if __name__ == "__main__":
    EXAMPLE.write_text(example(), encoding="utf-8")
