"""Hostile arguments and file names."""

from __future__ import annotations

from collections.abc import Iterator

from tests.hostile.case import Case
from tests.hostile.recording_cases import SHEET
from tests.hostile.texts import STEERING

FILES = {"r.csv": SHEET.text()}
FAULTS = ["", "=", "A.leakage", "A.leakage=", "A.leakage=nan", "A.leakage=1e999", "A.leakage=-5"]
FAULTS += [
    "A.leakage=0.1@",
    "A.leakage=0.1@9:1",
    "[/x]=1",
    "\x1b[31m=1",
    "A.leakage=1" + "0" * 5000,
]
HELDOUT = ["", ":", "a:b", "nan:nan", "1:0", "0:1e999", "[/x]:1", "1:2:3"]
STUDY = [("--degrees", ""), ("--degrees", "x"), ("--degrees", "1e999"), ("--degrees", "[/x]")]
STUDY += [("--points", "0"), ("--points", "-1"), ("--jobs", "0"), ("--seeds", "9" * 5000)]


def cases() -> Iterator[Case]:
    for i, fault in enumerate(FAULTS):
        arguments = ("simulate", "{rules}", "r.csv", "-o", "out.csv", f"--fault={fault}")
        yield Case("arguments", f"fault {i}", arguments, FILES)
    for i, period in enumerate(HELDOUT):
        arguments = (
            "mismatch",
            "{plants}/abc",
            "r.csv",
            f"--heldout={period}",
            "--json=/no/x.json",
        )
        yield Case("arguments", f"heldout {i}", arguments, FILES)
    for i, (option, value) in enumerate(STUDY):
        yield Case("arguments", f"study {i}", ("study", "x.json", option, value))
    for name, text in STEERING.items():
        yield Case("arguments", f"{name} as a command", (text,))
        yield Case("arguments", f"{name} as an option", ("diagnose", "a", "b", f"--{text}"))
        yield Case("arguments", f"{name} as a pass", ("show", text, "{plants}/abc"))
        yield Case(
            "file names", f"{name} as a ruleset", ("diagnose", f"{text}.json", "r.csv"), FILES
        )
        yield Case("file names", f"{name} as a recording", ("diagnose", "{rules}", text))
        yield Case("file names", f"{name} as a mismatch", ("adopt", text, "-o", "new"))
        out = (
            "diagnose",
            "{rules}",
            f"{text}.csv",
            "--trace",
            f"t{text}.csv",
            "--report",
            "x.html",
        )
        yield Case("file names", f"{name}, read and written", out, {f"{text}.csv": SHEET.text()})
    for name, target in {
        "a folder": ".",
        "no folder": "no/such/out.csv",
        "a long name": "x" * 300,
        "a null": "a\0b",
        "the null device": "/dev/null",
        "a full device": "/dev/full",
        "a folder with a slash": "new/",
        "empty": "",
        "a surrogate": "x\udcff.csv",
    }.items():
        diagnose = ("diagnose", "{rules}", "r.csv", "--trace", target)
        yield Case("targets", f"trace to {name}", diagnose, FILES)
        simulate = ("simulate", "{rules}", "r.csv", "-o", target)
        yield Case("targets", f"simulated to {name}", simulate, FILES)
        yield Case("targets", f"inputs from {name}", ("simulate", "{rules}", target, "-o", "o.csv"))
    for name in ("out.csv", "out.csv.part"):
        arguments = ("simulate", "{rules}", "r.csv", "-o", "out.csv")
        link = {name: "../outside/precious"}
        yield Case("targets", f"a link at {name}", arguments, FILES, link)
