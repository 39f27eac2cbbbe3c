"""Out of MTPPy, which writes a manifest from a module in Python, and in again."""

from pathlib import Path
from typing import Any

import pytest

from tests.mtp.test_import import imported

pytest.importorskip(
    "mtppy.opcua_server_pea", reason="MTPPy, opcua and simple-pid are not installed"
)

TEMPLATE = (
    '<CAEXFile SchemaVersion="2.15" FileName="x"><AdditionalInformation><WriterHeader><WriterName/>'
    "<WriterVendor/></WriterHeader></AdditionalInformation></CAEXFile>"
)
STATES = (
    "idle", "starting", "execute", "completing", "completed", "pausing", "paused", "resuming",
    "holding", "held", "unholding", "stopping", "stopped", "aborting", "aborted", "resetting",
)  # fmt: skip


def written(folder: Path) -> str:
    """The manifest of a module with a service, a drive and two valves."""
    from mtppy.active_elements import AnaDrv, AnaVlv, BinVlv
    from mtppy.indicator_elements import AnaView, BinView, DIntView
    from mtppy.mtp_generator import MTPGenerator
    from mtppy.opcua_server_pea import OPCUAServerPEA
    from mtppy.operation_elements import AnaServParam
    from mtppy.procedure import Procedure
    from mtppy.service import Service

    (folder / "template.aml").write_text(TEMPLATE, encoding="utf-8")
    target = folder / "manifest.aml"
    writer = {"WriterName": "MTPPy", "WriterVendor": "tests"}
    generator = MTPGenerator(writer, str(target), str(folder / "template.aml"))
    module = OPCUAServerPEA(generator, endpoint="opc.tcp://127.0.0.1:4840/")
    body: dict[str, Any] = dict.fromkeys(STATES, lambda self: None)
    service = type("Dosing", (Service,), body)("dose", "doses")
    procedure = Procedure(1, "continuous", is_self_completing=False, is_default=True)
    procedure.add_procedure_parameter(AnaServParam("flow", v_min=0, v_max=100, v_unit=1353))
    procedure.add_report_value(AnaView("dp", "loss", v_scl_min=0, v_scl_max=10, v_unit=1137))
    procedure.add_report_value(DIntView("count", "strokes", v_unit=23))
    procedure.add_report_value(BinView("full", "tank is full"))
    service.add_procedure(procedure)
    module.add_service(service)
    module.add_active_element(AnaDrv("pump", rpm_scl_max=1500, rpm_unit=1085))
    module.add_active_element(AnaVlv("V1", pos_scl_max=100, pos_unit=1342))
    module.add_active_element(BinVlv("V2"))
    module._build_opcua_server()
    return target.read_text(encoding="utf-8")


def test_what_mtppy_writes_is_found(tmp_path: Path) -> None:
    """All tags, units and nodes, the service with its parameter, ranges as they were given."""
    text = written(tmp_path)
    module = imported(tmp_path, text)
    counts = module["counts"]
    assert (counts["tags"], counts["tags_present"]) == (9, 9)
    assert (counts["nodes"], counts["nodes_present"]) == (text.count("xs:IDREF") - 3,) * 2
    assert (counts["units"], counts["units_present"]) == (4, 5)
    signals = {s["signal"]: s for s in module["signals"]}
    assert {n: (s["unit"], s["range"]) for n, s in signals.items()} == {
        "flow": ("l/h", [0.0, 100.0]),
        "dp": ("bar", [0.0, 10.0]),
        "count": (None, [0.0, 100.0]),
        "pump": ("rpm", [0.0, 1500.0]),
        "V1": ("%", [0.0, 100.0]),
    }
    assert signals["pump"]["node"] == "ns=3;s=active_elements.pump.RpmFbk"
    assert signals["V1"]["quantity"] == "valve travel"
    (service,) = module["services"]
    (procedure,) = service["procedures"]
    assert (procedure["name"], procedure["default"]) == ("continuous", True)
    assert procedure["parameters"] == ["flow", "dp", "count", "full"]
    assert [o["kind"] for o in module["odd"]] == ["unknown units"]
