"""A folder of rigs: read it, and report its mistakes with place and remedy.

A rig is a folder with `plain/` (plant.yaml and the files it names: the plant without the effect),
`train*.csv` and `test.csv` (other days or set points), `rig.yaml`, and, if something is known,
`answer.yaml` with its seal `answer.sha256`. An `earlier.csv` calibrates the plain plant. Every
recording may be compressed (`.gz`).
"""

import gzip
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.write_file import write_data, write_text
from rulec_runtime.recordings.recording import read_recording

from rulec.knowledge.read import read_all
from rulec.knowledge.sources import table_of
from rulec.language.diagnostics import Diagnostic, Place, Refused
from rulec.language.read_yaml import Document, Path_, read_document
from rulec.language.schema import check_schema
from rulec.language.units import UnitTable
from rulec.mismatch.structure import hypotheses
from rulec.passes.pipeline import compile_plant

PLAIN, PLANT, ABOUT = "plain", "plant.yaml", "rig.yaml"
TRAIN, TEST, EARLIER = "train", "test", "earlier"
ANSWER, SEAL, ALARMS = "answer.yaml", "answer.sha256", "false-alarms.yaml"

SCHEMAS = Path(__file__).parent / "schema"
NO_UNITS = UnitTable({}, {})
OF_THE_TOOL = frozenset(
    (
        *(hypotheses.SWAPPED, hypotheses.UNIT, hypotheses.SIGN),
        *(hypotheses.CLOCK, hypotheses.CONNECTION),
        *("impossible-reading", "stuck-reading", "coarse-steps", "drop-outs"),
    )
)
"""Ids that the tool reports without an entry in the knowledge base: cables, headers, sensors."""


@dataclass(frozen=True)
class Size:
    """The true value ± u of a parameter, in `unit`; without a `name` it holds for every id."""

    parameter: str
    value: float
    u: float
    unit: str
    name: str = ""


@dataclass(frozen=True)
class Missing:
    """One thing that the plain plant leaves out.

    `names` are the right ids, empty if no entry names it; `places` are modules, or `module.place`
    as the tool reports them.
    """

    names: tuple[str, ...]
    places: tuple[str, ...]
    sizes: tuple[Size, ...] = ()


@dataclass(frozen=True)
class Truth:
    """The answer for a rig; without `missing`, the right report is empty.

    `beside` are ids that are neither required nor false; sizes may be stated in `units`.
    """

    missing: tuple[Missing, ...]
    beside: tuple[str, ...]
    source: str
    units: UnitTable = NO_UNITS


@dataclass(frozen=True)
class GreyBox:
    """Root mean square error of a hand-made model on the rows of test.csv, in `unit`."""

    signal: str
    error: float
    unit: str
    source: str


@dataclass(frozen=True, kw_only=True)
class Rig:
    """A rig whose folder is in order; `truth` is None if nothing is known, or if it is hidden."""

    folder: Path
    title: str
    licence: str
    source: str
    signal: str
    grey_box: tuple[GreyBox, ...]
    train: tuple[Path, ...]
    test: Path
    earlier: Path | None
    truth: Truth | None
    seal: str

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.folder.name


@dataclass(frozen=True)
class FalseAlarm:
    """A wrong finding that was once reported: id, place, what happened, and what is right."""

    rig: str
    wrong: str
    place: str
    story: str
    right: str


def rigs_in(folder: Path, only: str = "") -> list[Rig]:
    """Read the rigs whose name contains `only`; raises `Refusal` with all mistakes in them."""
    if not folder.is_dir():
        raise Refusal(
            f"--real {folder}: there is no such folder; rulec prove --make-rigs makes one"
        )
    places = sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith("."))
    chosen = [p for p in places if only in p.name]
    if not chosen:
        why = f"--only {only}: no rig has this in its name" if places else "there is no rig in it"
        raise Refusal(f"--real {folder}: {why}; a rig is a folder with {PLAIN}/ and {TRAIN}.csv")
    rigs, wrong = [], []
    for place in chosen:
        try:
            rigs.append(read_rig(place))
        except Refusal as refused:
            wrong.append(refused.for_terminal())
    if wrong:
        raise Refusal("\n".join(wrong))
    return rigs


def false_alarms_in(folder: Path) -> tuple[FalseAlarm, ...]:
    """Read the manifest beside the rigs; empty if there is no such file."""
    file = folder / ALARMS
    if not file.is_file():
        return ()
    return tuple(FalseAlarm(**entry) for entry in checked(file, "false-alarms")["false_alarms"])


def read_rig(folder: Path) -> Rig:
    """Read and check a rig; raises `Refusal` with place and remedy."""
    about = checked(_needed(folder / ABOUT, "name, title, licence and source"), "rig")
    plant = _needed(folder / PLAIN / PLANT, "the plant without the effect")
    train, tests, earlier = (recordings_of(folder, part) for part in (TRAIN, TEST, EARLIER))
    for part, files, meant in ((TRAIN, train, "shown to the tool"), (TEST, tests, "kept from it")):
        if not files:
            raise _lacking(folder / f"{part}.csv", f"rows that are {meant}")
    if len(tests) > 1:
        raise _lacking(folder / f"{TEST}.csv", "one file with all rows that are kept from the tool")
    if earlier and "calibration" in _read(plant).data:
        message = f"there is an '{earlier[0].name}', but the plant is calibrated already"
        place = _read(plant).key("calibration")
        raise Refused([Diagnostic(place, "KB023", message, "leave one of them out")])
    rules = compile_plant(plant)
    _in_order(_read(folder / ABOUT), rules)
    _same_readings(rules, train, tests[0])
    return Rig(
        folder=folder,
        title=about["title"],
        licence=about["licence"],
        source=about["source"],
        signal=about.get("signal", ""),
        grey_box=tuple(GreyBox(**figure) for figure in about.get("grey_box", ())),
        train=train,
        test=tests[0],
        earlier=earlier[0] if earlier else None,
        truth=_truth(folder, rules),
        seal=_seal(folder),
    )


def recordings_of(folder: Path, part: str) -> tuple[Path, ...]:
    """Return the files of a part: `train.csv`, `train-2.csv.gz` and so on."""
    return tuple(sorted((*folder.glob(f"{part}*.csv"), *folder.glob(f"{part}*.csv.gz"))))


def checked(file: Path, kind: str) -> Mapping[str, Any]:
    """Read a YAML file and check it against its schema; raises `Refused` with every mistake."""
    document = _read(file)
    if wrong := check_schema(document, kind, SCHEMAS):
        raise Refused(wrong)
    found: Mapping[str, Any] = document.data
    return found


def _read(file: Path) -> Document:
    document, wrong = read_document(file)
    if document is None:
        raise Refused(wrong)
    return document


def _in_order(about: Document, rules: Ruleset) -> None:
    """Check that named readings exist in the plant, and that figures are in their units."""
    wrong, named = [], list[tuple[Path_, str, str]]()
    if "signal" in about.data:
        named.append((("signal",), about.data["signal"], ""))
    for number, figure in enumerate(about.data.get("grey_box", ())):
        named.append((("grey_box", number, "signal"), figure["signal"], figure["unit"]))
    for path, name, unit in named:
        signals = rules.signal_by_id
        if name not in signals:
            hint = did_you_mean(name, signals)
            message = f"the plant has no reading '{name}'"
            wrong.append(Diagnostic(about.place(*path), "KB023", message, hint))
        elif unit and unit != signals[name].unit:
            message, hint = f"'{name}' is in {signals[name].unit}", "give its error in that unit"
            wrong.append(Diagnostic(about.place(*path), "KB023", message, hint))
    if wrong:
        raise Refused(wrong)


def _needed(file: Path, meant: str) -> Path:
    if not file.is_file():
        raise _lacking(file, meant)
    return file


def _lacking(file: Path, meant: str) -> Refused:
    message = f"a rig needs '{file.name}'"
    return Refused([Diagnostic(Place(str(file.parent)), "KB001", message, f"put there {meant}")])


def _same_readings(rules: Ruleset, train: Sequence[Path], test: Path) -> None:
    """Check that every file is a recording of the plant, and that `test` has all its columns."""
    shown = {name for file in train for name in read_recording(file, rules).values}
    lacking = sorted(shown - set(read_recording(test, rules).values))
    if lacking:
        message = f"{test.name} lacks columns that {TRAIN} has: {', '.join(lacking)}"
        raise Refused([Diagnostic(Place(str(test)), "KB001", message, "write the same columns")])


def _seal(folder: Path) -> str:
    """The hash that was written when the rig was made; empty without one.

    Raises `Refused` if the answer is not the one that was sealed.
    """
    answer, seal = folder / ANSWER, folder / SEAL
    if not seal.is_file():
        if answer.is_file():
            raise _lacking(seal, f"the SHA-256 of {ANSWER}: sha256sum {ANSWER} > {SEAL}")
        return ""
    written = seal.read_text(encoding="utf-8", errors="replace").split()
    found = digest_of(answer) if answer.is_file() else ""
    if not written or (found and written[0].lower() != found):
        message = f"{ANSWER} is not the one that was sealed: its SHA-256 is {found or 'unknown'}"
        hint = "bring back the sealed answer, or seal this one anew and say so"
        raise Refused([Diagnostic(Place(str(seal)), "KB023", message, hint)])
    return written[0].lower()


def digest_of(file: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _truth(folder: Path, rules: Ruleset) -> Truth | None:
    """The answer; ids must have an entry, modules be in the plant, units be known."""
    file = folder / ANSWER
    if not file.is_file():
        return None
    found = checked(file, "sealed-answer")
    document, knowledge = _read(file), read_all(folder / PLAIN).by_kind
    units, wrong = table_of(knowledge.get("units", ()), []), list[Diagnostic]()
    entries = {d.data[kind] for kind in ("effect", "fault") for d in knowledge.get(kind, ())}
    allowed = {
        "names": (entries | OF_THE_TOOL, "effect or fault"),
        "places": (
            {signal.id.partition(".")[0] for signal in rules.signals},
            "module of the plant",
        ),
    }
    for number, effect in enumerate(found.get("effects", ())):
        for key, (right, what) in allowed.items():
            for word in (text.partition(".")[0] for text in _list(effect[key])):
                if word not in right:
                    place, hint = document.place("effects", number, key), did_you_mean(word, right)
                    wrong.append(Diagnostic(place, "KB023", f"there is no {what} '{word}'", hint))
        for i, unit in enumerate(size["unit"] for size in effect.get("sizes", ())):
            try:
                units.parse(unit)
            except ValueError:
                place = document.place("effects", number, "sizes", i, "unit")
                hint = did_you_mean(unit, units.units)
                wrong.append(Diagnostic(place, "KB023", f"there is no unit '{unit}'", hint))
    if bool(found.get("nothing")) == bool(found.get("effects")):
        message = "an answer says either 'nothing: true' or 'effects'"
        hint = "where nothing is known, leave the file out"
        wrong.insert(0, Diagnostic(document.place("nothing"), "KB021", message, hint))
    if wrong:
        raise Refused(wrong)
    missing = tuple(
        Missing(_list(e["names"]), _list(e["places"]), tuple(Size(**s) for s in e.get("sizes", ())))
        for e in found.get("effects", ())
    )
    return Truth(missing, tuple(found.get("beside", ())), found["source"], units)


def _list(value: str | Sequence[str]) -> tuple[str, ...]:
    return (value,) if isinstance(value, str) else tuple(value)


def open_text(file: Path) -> IO[str]:
    """Open a text file, compressed or not."""
    if file.suffix == ".gz":
        return gzip.open(file, "rt", encoding="utf-8", newline="")
    return file.open(encoding="utf-8", newline="")


def write_packed(file: Path, text: str) -> None:
    """Write a text, compressed if the name ends in `.gz`."""
    data = text.encode()
    write_data(file, gzip.compress(data, mtime=0) if file.suffix == ".gz" else data)


def yaml_of(file: Path) -> dict[str, Any]:
    """Return the data of a YAML file that was checked before."""
    return dict(_read(file).data)


def write_yaml(file: Path, data: Mapping[str, Any]) -> None:
    """Write JSON, which is YAML: numbers and texts stay as they were read."""
    write_text(file, json.dumps(data, indent=1, ensure_ascii=False) + "\n")
