"""Hostile files in all places where one is read, paths that lead elsewhere, hostile arguments."""

import io
import json
import zipfile
from collections.abc import Iterator

import numpy as np
from rulec_runtime.live import limits

from tests.conftest import ROOT, compiled
from tests.hostile.case import ODD, Case, Content
from tests.hostile.recording_cases import SHEET
from tests.hostile.texts import CANARY, SECRETS, STEERING

PLANT = """plant: p
title: t
modules:
  A: {type: dosing-pcp}
  B: {type: dosing-pcp}
  C: {type: static-mixer}
"""
JOINED = PLANT + "connections: [A -> C, B -> C]\n"
SCHEMES = "reference data generic tar zip memory ftp local file simplecache::file"
ABC = ROOT / "plants" / "abc"
FLEET = f"fleet: f\nrecordings: recordings\njudged_by: {ABC}\n"
DAY = "recordings/plant=p/day=2026-01-01"
BASE: dict[str, Content] = {"r.csv": SHEET.text()}
NAMED: dict[str, Content] = {"p/plant.yaml": JOINED + "kb: ../k\n", "k/f.yaml": "fault: f\n"}
OTHER: dict[str, Content] = {"f.yaml": FLEET.replace(str(ABC), "x.json")}
MQTT = ("--mqtt", "mqtts://localhost", "--mqtt-ca", "x")
WATCH = ("watch", "{rules}", "--until-end", "--source")

PLACES: dict[str, tuple[str, tuple[str, ...], dict[str, Content]]] = {
    "plant": ("x.yaml", ("check", "x.yaml"), {}),
    "folder of a plant": ("p/plant.yaml", ("compile", "p", "-o", "o.json"), {}),
    "columns": ("x", ("check", "plant.yaml"), {"plant.yaml": JOINED + "columns: x\n"}),
    "calibration": ("x", ("check", "plant.yaml"), {"plant.yaml": JOINED + "calibration: [x]\n"}),
    "adjacency": ("x", ("check", "plant.yaml"), {"plant.yaml": PLANT + "adjacency: x\n"}),
    "knowledge": ("p/kb/x.yaml", ("check", "p"), {"p/plant.yaml": JOINED}),
    "named knowledge": ("k/x.yaml", ("compile", "p", "-o", "o.json"), NAMED),
    "schemas": ("f/x.yaml", ("schema", "f"), {"f/y.yaml": "fault: f\n"}),
    "ruleset": ("x.json", ("diagnose", "x.json", "r.csv"), BASE),
    "recording": ("x.csv", ("diagnose", "{rules}", "x.csv", "--json", "o.json"), {}),
    "recording of its own kind": ("x.parquet", ("diagnose", "{rules}", "x.parquet"), {}),
    "folder of recordings": ("f/x.csv", ("diagnose", "{rules}", "f"), {"f/r.csv": SHEET.text()}),
    "checked recording": ("x.csv", ("check", "{plants}/abc", "x.csv"), {}),
    "calibrated recording": ("x.csv", ("calibrate", "{plants}/abc", "x.csv", "-o", "c.yaml"), {}),
    "compared recording": ("x.csv", ("mismatch", "{plants}/abc", "x.csv"), {}),
    "inputs": ("x.csv", ("simulate", "{rules}", "x.csv", "-o", "o.csv"), {}),
    "truth": ("x.csv", ("diagnose", "{rules}", "r.csv", "--truth", "x.csv", "-q"), BASE),
    "limits": ("x.yaml", ("diagnose", "{plants}/abc", "r.csv", "--limits", "x.yaml"), BASE),
    "fleet": ("x.yaml", ("fleet", "x.yaml"), {}),
    "ruleset of a fleet": ("x.json", ("fleet", "f.yaml"), OTHER),
    "mismatch to adopt": ("x.json", ("adopt", "x.json", "-o", "new"), {}),
    "mismatch to tell apart": ("x.json", ("experiment", "x.json"), {}),
    "source": ("x.csv", (*WATCH, "x.csv"), {}),
    "map": ("x.yaml", (*WATCH, "mqtt://localhost", "--map", "x.yaml"), {}),
    "state": ("x", (*WATCH, "r.csv", "--state", "x"), BASE),
    "events": ("x", (*WATCH, "r.csv", "--events", "x"), BASE),
    "journal": ("x", ("journal", "x"), {}),
    "authorities": ("x", (*WATCH, "r.csv", *MQTT, "--waiting", "."), BASE),
    "package": ("x.mtp", ("import", "mtp", "x.mtp", "-o", "new"), {}),
}
"""Where a file is read: its name, the command, and the other files."""

LEAKING = ("a list of users", "broken YAML", "JSON")


def cases() -> Iterator[Case]:
    for place, (name, arguments, files) in PLACES.items():
        for kind in ODD if place in ("plant", "recording", "source") else ("a pipe", "a folder"):
            yield Case("no files", f"{kind} as {place}", arguments, files, odd={name: kind})
        some = SECRETS if place in ("plant", "recording", "source") else LEAKING
        for kind in some:
            own = {**files, name: SECRETS[kind]}
            yield Case("files of others", f"{kind} as {place}", arguments, own)
        link = {name: "../" * (1 + name.count("/")) + "outside/precious"}
        yield Case("links", f"out, as {place}", arguments, files, link)
    yield from _paths()
    yield from _sizes()
    yield from _arguments()


def _paths() -> Iterator[Case]:
    aims = ["/etc/passwd", "../" * 12 + "etc/passwd", "away/passwd", "/proc/self/environ",
            "/dev/zero"]  # fmt: skip
    keys = {
        "columns": JOINED + "columns: {}\n",
        "calibration": JOINED + "calibration: [{}]\n",
        "adjacency": PLANT + "adjacency: {}\n",
        "kb": JOINED + "kb: {}\n",
        "fleet": FLEET.replace(str(ABC), "{}"),
        "recordings": FLEET.replace(": recordings", ": {}"),
        "results": FLEET + "results: {}\n",
    }
    for key, text in keys.items():
        for aim in aims:
            files = {"p/plant.yaml": text.replace("{}", aim), f"p/{DAY}/r.csv": SHEET.text()}
            arguments = ("fleet", "p/plant.yaml") if text.startswith("fleet") else ("check", "p")
            yield Case("paths", f"{key} {aim}", arguments, files, {"p/away": "/etc"})
    for scheme in SCHEMES.split():
        place = f"recordings: {scheme}:///etc/x"
        files = {"f.yaml": FLEET.replace("recordings: recordings", place)}
        yield Case("paths", f"a fleet at {scheme}", ("fleet", "f.yaml"), files)


def _sizes() -> Iterator[Case]:
    wide = "time [s]" + ",x" * 2_000_000 + "\n0" + ",1" * 2_000_000 + "\n"
    texts = [
        wide,
        wide.replace(",", ";"),
        "time [s],A.dp [bar]\n" + "1" * 20_000_000,
        "A" * 20_000_000 + "\n1\n",
        "time [s],A.dp [bar]\n" + "\0" * 1000,
    ]
    for place in ("recording", "source"):
        file, arguments, _ = PLACES[place]
        for i, text in enumerate(texts):
            yield Case("sizes", f"{i} as {place}", arguments, {file: text})
    for name, raw in _states():
        file, arguments, files = PLACES["state"]
        yield Case("sizes", f"{name} as state", arguments, {**files, file: raw})


def _states() -> Iterator[tuple[str, bytes]]:
    def archive(text: object, compressed: bool = False, **arrays: np.ndarray) -> bytes:
        file = io.BytesIO()
        write = np.savez_compressed if compressed else np.savez
        write(file, text=np.array(json.dumps(text)), **arrays)
        return file.getvalue()

    yield "a packed bomb", archive({}, True, time=np.zeros(20_000_000, bool))
    yield "another text", archive([CANARY])
    yield "a number", archive(1)
    yield "a deep text", archive(CANARY).replace(CANARY.encode(), b"[" * len(CANARY))
    rules = compiled("abc")
    own = {"form": limits.STATE_FORM, "plant": rules.plant, "sources": rules.sources, "dated": 1}
    yield "half a state", archive(own)
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({10**15},), }}"
    npy = b"\x93NUMPY\x01\0v\0" + head.encode().ljust(117) + b"\n"
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as packed:
        packed.writestr("text.npy", npy)
    yield "a petabyte in its head", file.getvalue()
    yield "an array", npy
    yield "a pickle", b"\x80\x04\x95" + b"c" * 100


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


def _arguments() -> Iterator[Case]:
    for i, fault in enumerate(FAULTS):
        yield Case("arguments", f"fault {i}", (*SIMULATE, "out.csv", f"--fault={fault}"), BASE)
    for i, period in enumerate(PERIODS):
        words = ("mismatch", "{plants}/abc", "r.csv", f"--heldout={period}", "--json=/no/x.json")
        yield Case("arguments", f"heldout {i}", words, BASE)
    for i, (option, value) in enumerate(STUDY):
        yield Case("arguments", f"study {i}", ("study", "x.json", option, value))
    for name, text in STEERING.items():
        yield Case("arguments", f"{name} as a command", (text,))
        words = ("diagnose", "{rules}", f"{text}.csv", "--trace", f"t{text}.csv")
        files = {f"{text}.csv": SHEET.text()}
        yield Case("file names", f"{name}, read and written", (*words, "--report", "x.html"), files)
    for place, form in NAMED.items():
        words = tuple(word.replace("{}", STEERING["escape"]) for word in form)
        yield Case("file names", f"as {place}", words, BASE)
    for i, target in enumerate(TARGETS):
        diagnose = ("diagnose", "{rules}", "r.csv", "--trace", target)
        yield Case("targets", f"trace to {i}", diagnose, BASE)
        yield Case("targets", f"simulated to {i}", (*SIMULATE, target), BASE)
        yield Case("targets", f"inputs from {i}", ("simulate", "{rules}", target, "-o", "o.csv"))
    for name in ("out.csv", "out.csv.part"):
        link = {name: "../outside/precious"}
        yield Case("targets", f"a link at {name}", (*SIMULATE, "out.csv"), BASE, link)
