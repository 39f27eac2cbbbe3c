"""The command `rulec`: reads arguments, calls one command, turns mistakes into messages.

This is the one place where compiler and runtime meet. Commands are imported when they are called:
the runtime verbs must start without sympy.
"""

from __future__ import annotations

import argparse
import importlib
import os
from collections.abc import Sequence

from rulec_runtime.commands.frame import (
    MODE,
    Parser,
    carried_out,
    diagnose_options,
    journal_options,
    json_option,
    prepare_process,
    quiet_option,
    version_option,
    watch_options,
)

_COMMANDS = {
    "init": "write a commented skeleton: plant, module, fault, effect, or a package of knowledge",
    "schema": "write schemas for editors, and link YAML files to them",
    "check": "validate knowledge and plant files",
    "import": "make module types from the files of other tools, or from a maker's points",
    "compile": "derive the ruleset of a plant",
    "export": "write the observers of a plant's modules as code for their controllers",
    "matrix": "show the fault-symptom matrix of a plant",
    "show": "show what a compiler pass made, in readable equations",
    "calibrate": "fit the parameters of a plant to a recording",
    "diagnose": "judge a recording: which fault, how large, and why",
    "watch": "judge a plant while it runs, and report what begins, grows and ends",
    "journal": "list, filter and export the events of a watched plant",
    "fleet": "judge many plants on many days, and rank them",
    "simulate": "predict a recording from its inputs, with faults if asked for",
    "mismatch": "show where simulation and recording differ, and what physics the model lacks",
    "experiment": "plan the set points that separate the explanations a mismatch leaves open",
    "adopt": "write the plant that a mismatch asks for, with amended module types",
    "study": "test the diagnosis of a plant on simulated faults",
    "prove": "measure on hidden test cases how reliable the answers of mismatch are",
    "mcp": "answer agents by the Model Context Protocol, on standard input and output",
    "demo": "see the whole thing on a shipped example",
    "completion": "write the completion script of a shell",
}

_PLANT = "folder with a plant.yaml, or the file itself"
_PLANT_OR_RULESET = f"{_PLANT}; or the ruleset that rulec compile wrote"

ASKED_BY_SHELL = "_ARGCOMPLETE"
"""Variable by which a shell asks what may come next; see `rulec completion`."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code (0 done, 1 bad input, 2 usage, 3 see help)."""
    prepare_process()
    parser = _parser()
    if ASKED_BY_SHELL in os.environ:
        import argcomplete

        argcomplete.autocomplete(parser)
    options = parser.parse_args(arguments)
    module = importlib.import_module(f"rulec.commands.{options.command}")
    told = options.command.replace("_", " ")
    return carried_out(lambda: int(module.run(options)), f"rulec {told}")


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="rulec",
        description="Fault diagnosis for modular hydraulic plants, compiled from module files.",
        epilog="Begin with 'rulec demo', or with a plant of your own: 'rulec init plant NAME', "
        "then 'rulec check NAME'. PLANT is a folder with a plant.yaml, or the file itself. "
        "Exit code: 0 done, 1 mistakes found or bad input, 2 wrong usage, 3 if diagnose was "
        "partly blind, mismatch is unsure, or as --fail-on says.",
    )
    version_option(parser, "rulec")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    made = {
        name: commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        for name, text in _COMMANDS.items()
    }
    _init(made["init"])
    made["schema"].add_argument(
        "folder",
        metavar="FOLDER",
        help="schemas go to FOLDER/schema, links into YAML files below it",
    )
    made["check"].add_argument(
        "paths",
        nargs="+",
        metavar="PATH",
        help="YAML file or folder; PLANT RECORDING: also what the recording can be used for",
    )
    made["check"].add_argument(
        "--format",
        choices=("text", "json", "sarif"),
        default="text",
        help="json and sarif go to standard output, for editors and CI servers",
    )
    made["check"].add_argument(
        "--write-map",
        nargs="?",
        const="-",
        metavar="FILE",
        help="propose a column map for RECORDING; without FILE it goes to standard output",
    )
    _import(made["import"])
    made["compile"].add_argument("plant", metavar="PLANT", help=_PLANT)
    made["compile"].add_argument(
        "-o", "--output", metavar="FILE", help="ruleset; default: PLANT.ruleset.json"
    )
    _export(made["export"])
    made["matrix"].add_argument("plant", metavar="PLANT", help=_PLANT)
    made["matrix"].add_argument(
        "--separate",
        action="store_true",
        help="for each pair of similar faults, show the set points that separate them best",
    )
    _limits(made["matrix"])
    made["matrix"].add_argument("--report", metavar="FILE.html", help="one page, to hand on")
    json_option(made["matrix"])
    made["show"].add_argument(
        "step",
        metavar="PASS",
        help="name of a pass, 'passes' for a list, or 'knowledge': what is known, and from where",
    )
    made["show"].add_argument("plant", metavar="PLANT", nargs="?", help="'knowledge' needs none")
    made["calibrate"].add_argument("plant", metavar="PLANT", help=_PLANT)
    made["calibrate"].add_argument("recording", metavar="RECORDING", help="fault-free recording")
    made["calibrate"].add_argument("-o", "--output", metavar="FILE", required=True)
    made["calibrate"].add_argument(
        "--learn",
        metavar="M.DEFINITION",
        help="learn a definition of a module as a monotone curve instead; FILE is then a module "
        "type with a table in place of the definition",
    )
    made["calibrate"].add_argument(
        "--over",
        metavar="SIGNAL",
        help="with --learn: input of the curve; default: the only one of the definition",
    )
    made["calibrate"].add_argument(
        "--force", action="store_true", help="also write values that are too far from the sheet"
    )
    json_option(made["calibrate"])
    diagnose_options(made["diagnose"], "PLANT_OR_RULESET", _PLANT_OR_RULESET)
    _limits(made["diagnose"])
    watch_options(made["watch"], "PLANT_OR_RULESET", _PLANT_OR_RULESET)
    journal_options(made["journal"])
    _fleet(made["fleet"])
    _experiment(made["experiment"])
    made["adopt"].add_argument("mismatch", metavar="MISMATCH.json", help="from rulec mismatch")
    made["adopt"].add_argument(
        "-o", "--output", metavar="DIR", required=True, help="new folder, to be used as PLANT"
    )
    made["adopt"].add_argument(
        "--recalibrated",
        action="store_true",
        help="write the unchanged model with recalibrated values only",
    )
    _simulate(made["simulate"])
    _mismatch(made["mismatch"])
    _study(made["study"])
    prove_options(made["prove"])
    made["mcp"].add_argument(
        "folder", metavar="FOLDER", nargs="?", default=".", help="folder whose files may be read"
    )
    _demo(made["demo"])
    shells = ("bash", "zsh", "fish")
    made["completion"].add_argument("shell", metavar="SHELL", choices=shells, help="|".join(shells))
    for name, command in made.items():
        if name != "import":  # its formats have it
            quiet_option(command)
    return parser


def _init(init: argparse.ArgumentParser) -> None:
    init.add_argument(
        "kind",
        choices=("plant", "module", "fault", "effect", "kb"),
        help="what to write; kb: a package of knowledge",
    )
    init.add_argument("name", metavar="NAME", help="name of what is described")
    init.add_argument(
        "folder",
        metavar="FOLDER",
        nargs="?",
        help="folder to write to: the plant's (plant), a knowledge folder such as the plant's kb "
        "(module, fault, effect), or that of the package (kb); existing files are never replaced. "
        "Default: a new folder NAME (plant, kb), else this one",
    )
    init.add_argument(
        "--like", metavar="PLANT", help="begin with a copy of a shipped plant, such as cooling-loop"
    )


def _export(export: argparse.ArgumentParser) -> None:
    export.add_argument("plant", metavar="PLANT_OR_RULESET", help=_PLANT_OR_RULESET)
    export.add_argument(
        "--to",
        choices=("c", "st"),
        required=True,
        help="c: C99; st: structured text of IEC 61131-3",
    )
    export.add_argument(
        "-o", "--output", metavar="DIR", required=True, help="folder for the files of all modules"
    )
    export.add_argument(
        "--play",
        metavar="RECORDING",
        help="also write results.csv: what the code answers for each settled window of a recording",
    )


def _import(importer: argparse.ArgumentParser) -> None:
    formats = importer.add_subparsers(dest="format", required=True, metavar="FORMAT")
    text = "Module Type Packages (VDI/VDE/NAMUR 2658): .mtp, .zip or .aml"
    mtp = formats.add_parser("mtp", help=text, description=f"{text}.")
    mtp.set_defaults(command="import_mtp")
    mtp.add_argument("files", nargs="+", metavar="FILE", help="one module each")
    mtp.add_argument(
        "-o", "--output", metavar="DIR", required=True, help="new folder for modules and map"
    )
    mtp.add_argument(
        "--online",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="read units and ranges from the controllers if files do not state them; for one file, "
        "ADDRESS replaces the one in it, as in opc.tcp://10.0.0.5:4840",
    )
    text = "points of a maker's sheet (CSV, Excel): fits the law of a module type to them"
    curve = formats.add_parser("curve", help=text, description=f"{text[0].upper()}{text[1:]}.")
    curve.set_defaults(command="import_curve")
    curve.add_argument("file", metavar="FILE", help="a row of titles with units, then points")
    curve.add_argument("--type", metavar="TYPE", required=True, help="module type whose law it is")
    curve.add_argument(
        "-o", "--output", metavar="MODULE.yaml", required=True, help="module type to be written"
    )
    curve.add_argument(
        "--name", metavar="NAME", help="name of the new module type; default: that of its file"
    )
    curve.add_argument(
        "--grade",
        metavar="GRADE",
        help="tolerance of the sheet: 1B, 2B, 3B (ISO 9906), or as in '10 %%, IEC 60534-2-4'; "
        "default: the accuracy that the type states",
    )
    curve.add_argument(
        "--at",
        metavar="NAME=VALUE UNIT",
        action="append",
        default=[],
        help="a reading or a parameter that is the same at all points, as 'n=2900 rpm'; repeatable",
    )
    curve.add_argument(
        "--columns",
        metavar="TITLES",
        help="titles that replace those of the file, as 'Q [l/s], H [m]'",
    )
    curve.add_argument("--source", metavar="TEXT", help="of the points; default: name of the file")
    curve.add_argument(
        "--force", action="store_true", help="write the type even if the fit exceeds the tolerance"
    )
    for one in (mtp, curve):
        json_option(one)
        quiet_option(one)


def _experiment(experiment: argparse.ArgumentParser) -> None:
    experiment.add_argument("mismatch", metavar="MISMATCH.json", help="from rulec mismatch")
    experiment.add_argument(
        "-o", "--output", metavar="INPUTS.csv", help="inputs of the experiment, for rulec simulate"
    )
    experiment.add_argument(
        "--hours", type=float, default=8.0, help="longest duration (default 8 hours)"
    )
    experiment.add_argument(
        "--steps", metavar="N", type=int, default=18, help="at most N steps (default 18)"
    )
    _limits(experiment)
    experiment.add_argument(
        "--report", metavar="FILE.html", help="one page with pictures, to hand on"
    )
    json_option(experiment)


def _limits(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--limits",
        metavar="LIMITS.yaml",
        help="ranges, rates of change and costs of set points, for planned experiments",
    )


def _engine_options(command: argparse.ArgumentParser) -> None:
    """Where many pieces of work are done."""
    command.add_argument(
        "--engine",
        choices=("local", "dask"),
        default="local",
        help="local: processes of this machine; dask: a cluster of dask.distributed",
    )
    command.add_argument("--jobs", type=int, metavar="N", help="processes; default: one per core")
    command.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of an existing cluster, as tcp://host:8786; default: one on this machine",
    )


def _fleet(fleet: argparse.ArgumentParser) -> None:
    fleet.add_argument("fleet", metavar="FLEET.yaml", help="plants, recordings, days, results")
    _engine_options(fleet)
    fleet.add_argument(
        "--again", action="store_true", help="judge everything again, also what has not changed"
    )
    fleet.add_argument(
        "--results",
        metavar="FOLDER",
        help="write to FOLDER; FLEET.yaml itself can only name a folder below its own",
    )
    fleet.add_argument(
        "--mismatch", action="store_true", help="ask instead what physics the models lack"
    )
    json_option(fleet)


def _simulate(simulate: argparse.ArgumentParser) -> None:
    simulate.add_argument("plant", metavar="PLANT_OR_RULESET", help=_PLANT_OR_RULESET)
    simulate.add_argument(
        "inputs",
        metavar="INPUTS",
        help="recording, as for diagnose; only readings that no equation determines, such as "
        "speeds, are used",
    )
    simulate.add_argument(
        "-o",
        "--output",
        metavar="RECORDING",
        required=True,
        help="CSV file, or - for standard output; a folder if INPUTS is one",
    )
    simulate.add_argument(
        "--fault",
        metavar="M.FAULT=DEGREE",
        action="append",
        default=[],
        help="add a fault, optionally from one second to another (@FROM:TO); repeatable",
    )
    simulate.add_argument(
        "--noise", metavar="SEED", type=int, help="add sensor errors, drawn with this seed"
    )
    simulate.add_argument(
        "--start",
        metavar="RECORDING",
        help="take initial levels and temperatures from the first readings of this recording; if "
        "INPUTS is a folder, a folder with files of the same names",
    )


def _mismatch(mismatch: argparse.ArgumentParser) -> None:
    mismatch.add_argument("plant", metavar="PLANT", help=_PLANT)
    mismatch.add_argument(
        "recording",
        metavar="RECORDING",
        nargs="+",
        help="as for diagnose; several of one plant are judged together, in the given order unless "
        "their files have dates",
    )
    mismatch.add_argument(
        "--heldout",
        action="append",
        default=[],
        metavar="FROM:TO",
        help="period in seconds, kept for validation and not used in the search; repeatable; "
        "default: blocks chosen by the tool",
    )
    mismatch.add_argument(
        "--report", metavar="FILE.html", help="one page with pictures, to hand on"
    )
    mismatch.add_argument(
        "--series",
        metavar="FILE.csv",
        help="measured and predicted values of each sample; - for standard output",
    )
    mismatch.add_argument(
        "--power",
        metavar="EFFECT",
        nargs="*",
        help="also estimate how often this recording would reveal an effect (by its id; default: "
        "those found), and how often it would show one where nothing is missing",
    )
    json_option(mismatch)


def _study(study: argparse.ArgumentParser) -> None:
    study.add_argument("plant", metavar="PLANT", help=_PLANT)
    study.add_argument(
        "--degrees",
        default="0.1,0.2,0.3",
        metavar="X,Y",
        help="degrees of every fault, 0.1 for 10 %%; default %(default)s",
    )
    for name, default, text in (
        ("--points", 3, "operating points"),
        ("--seeds", 3, "plants drawn per fault"),
        ("--lead-in", 0, "healthy samples before the fault"),
    ):
        text = f"{text}; default {default}"
        study.add_argument(name, type=int, default=default, metavar="N", help=text)
    _engine_options(study)
    study.add_argument("--mode", choices=("default", "paper"), default="default", help=MODE)
    study.add_argument(
        "--bounded", action="store_true", help="sensor errors stay inside the bounds of their class"
    )
    study.add_argument("--report", metavar="FILE.html", help="one page, to hand on")
    json_option(study)


def _demo(demo: argparse.ArgumentParser) -> None:
    demo.add_argument(
        "--live",
        action="store_true",
        help="run a whole plant on this machine: servers of its modules, and rulec watch",
    )
    demo.add_argument(
        "--speed",
        type=float,
        default=10.0,
        metavar="X",
        help="with --live: play X times faster than recorded (default 10)",
    )


def prove_options(prove: argparse.ArgumentParser) -> None:
    """Options of `rulec prove`, the same for the suite that it starts."""
    which = prove.add_mutually_exclusive_group()
    which.add_argument(
        "--quick", action="store_true", help="about 40 small cases, in a few minutes"
    )
    which.add_argument("--final", action="store_true", help="the cases kept for the final proof")
    which.add_argument("--seed", type=int, metavar="N", help="new cases, drawn with this seed")
    which.add_argument(
        "--real", metavar="DIR", help="real recordings: a folder of rigs; see docs/proof.md"
    )
    which.add_argument(
        "--make-rigs",
        nargs=3,
        metavar=("RECIPES", "SOURCE", "DIR"),
        help="make a folder of rigs from recipes and a copy of the recordings",
    )
    which.add_argument(
        "--blind",
        nargs=2,
        metavar=("PLANT", "RECORDING"),
        help="hide every effect of the catalogue in replays of your recording, and report which "
        "of them rulec mismatch would find",
    )
    cases = prove.add_mutually_exclusive_group()
    cases.add_argument(
        "--hard",
        action="store_true",
        help="cases with form errors, coloured noise, drifts, and wrong cables or files",
    )
    cases.add_argument(
        "--production",
        action="store_true",
        help="settled plants that make a few products within part of their range; with --rounds 2 "
        "experiments may use the range of a file of limits. All cases are small: --quick changes "
        "nothing",
    )
    cases.add_argument(
        "--contacts",
        action="store_true",
        help="first contacts: plants with data sheets and one recording of ordinary operation, "
        "half of them with a law of another standard form",
    )
    prove.add_argument(
        "--only",
        default="",
        metavar="WORD",
        help="cases with WORD in their name, such as slip-warm",
    )
    prove.add_argument(
        "--hidden-names",
        action="store_true",
        help="with --real: run each rig again with other names of modules and columns, and show "
        "how the answers differ",
    )
    prove.add_argument(
        "--limit",
        type=float,
        metavar="S",
        help="with --real: time limit of a command in seconds (default 1800)",
    )
    prove.add_argument(
        "--rounds",
        type=int,
        choices=(1, 2),
        default=1,
        help="2: where several explanations remain, plan an experiment, run it on the same plant, "
        "and ask again (settled plants)",
    )
    prove.add_argument(
        "--baselines",
        nargs="*",
        choices=("same", "random"),
        help="with --rounds 2: compare the recipe with the same inputs again, and with random ones "
        "of equal length (default: both); each costs one more search per case",
    )
    _engine_options(prove)
    prove.add_argument(
        "--keep",
        metavar="DIR",
        help="keep all files there, and resume an interrupted run from there",
    )
    prove.add_argument("--json", metavar="FILE", help="all judged cases as JSON")
    prove.add_argument("--report", metavar="FILE.html", help="one page with pictures")


if __name__ == "__main__":
    raise SystemExit(main())
