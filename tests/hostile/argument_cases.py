"""Hostile arguments and file names."""

from __future__ import annotations

from collections.abc import Iterator

from tests.hostile.case import Case
from tests.hostile.recording_cases import SHEET
from tests.hostile.texts import STEERING

FILES = {"r.csv": SHEET.text()}
FAULTS = ["", "=", "A.leakage", "A.leakage=nan", "A.leakage=1e999", "A.leakage=-5",
          "A.leakage=0.1@", "A.leakage=0.1@9:1", "[/x]=1", "\x1b[31m=1",
          "A.leakage=1" + "0" * 5000]  # fmt: skip
PERIODS = ["", ":", "a:b", "nan:nan", "1:0", "0:1e999", "[/x]:1", "1:2:3"]
STUDY = [("--degrees", ""), ("--degrees", "1e999"), ("--degrees", "[/x]"), ("--points", "-1"),
         ("--jobs", "0"), ("--seeds", "9" * 5000)]  # fmt: skip
TARGETS = [".", "no/such/out.csv", "x" * 300, "a\0b", "/dev/null", "/dev/full", "new/", "",
           "x\udcff.csv"]  # fmt: skip
SIMULATE = ("simulate", "{rules}", "r.csv", "-o")
NAMED: dict[str, tuple[str, ...]] = {
    "an option": ("diagnose", "a", "b", "--{}"),
    "a pass": ("show", "{}", "{plants}/abc"),
    "a ruleset": ("diagnose", "{}.json", "r.csv"),
    "a recording": ("diagnose", "{rules}", "{}"),
    "a mismatch": ("adopt", "{}", "-o", "new"),
}


def cases() -> Iterator[Case]:
    for i, fault in enumerate(FAULTS):
        yield Case("arguments", f"fault {i}", (*SIMULATE, "out.csv", f"--fault={fault}"), FILES)
    for i, period in enumerate(PERIODS):
        words = ("mismatch", "{plants}/abc", "r.csv", f"--heldout={period}", "--json=/no/x.json")
        yield Case("arguments", f"heldout {i}", words, FILES)
    for i, (option, value) in enumerate(STUDY):
        yield Case("arguments", f"study {i}", ("study", "x.json", option, value))
    for name, text in STEERING.items():
        yield Case("arguments", f"{name} as a command", (text,))
        words = ("diagnose", "{rules}", f"{text}.csv", "--trace", f"t{text}.csv")
        files = {f"{text}.csv": SHEET.text()}
        yield Case("file names", f"{name}, read and written", (*words, "--report", "x.html"), files)
    for place, form in NAMED.items():
        words = tuple(word.replace("{}", STEERING["escape"]) for word in form)
        yield Case("file names", f"as {place}", words, FILES)
    for i, target in enumerate(TARGETS):
        diagnose = ("diagnose", "{rules}", "r.csv", "--trace", target)
        yield Case("targets", f"trace to {i}", diagnose, FILES)
        yield Case("targets", f"simulated to {i}", (*SIMULATE, target), FILES)
        yield Case("targets", f"inputs from {i}", ("simulate", "{rules}", target, "-o", "o.csv"))
    for name in ("out.csv", "out.csv.part"):
        link = {name: "../outside/precious"}
        yield Case("targets", f"a link at {name}", (*SIMULATE, "out.csv"), FILES, link)
