"""The command `rulec`: reads arguments, calls one command, turns mistakes into messages.

This is the one place where compiler and runtime meet. Commands are imported when they are called:
the runtime verbs must start without sympy.
"""

from __future__ import annotations

import argparse
import functools
import importlib
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

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

_PLANT = "folder with a plant.yaml, or the file itself"
_PLANT_OR_RULESET = f"{_PLANT}; or the ruleset that rulec compile wrote"
_SLOTS = {"plant": _PLANT, "plant_or_ruleset": _PLANT_OR_RULESET, "mode": MODE}
"""What stands for the words in braces in the help of options."""

_OF_RUNTIME: Mapping[str, Callable[[argparse.ArgumentParser], object]] = {
    "@json": json_option,
    "@journal": journal_options,
    "@diagnose": lambda parser: diagnose_options(parser, "PLANT_OR_RULESET", _PLANT_OR_RULESET),
    "@watch": lambda parser: watch_options(parser, "PLANT_OR_RULESET", _PLANT_OR_RULESET),
}
"""Options that `rulec-runtime` has, too."""

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
    commands = {name: one for name, one in _table().items() if "about" in one}
    _add_commands(parser.add_subparsers(dest="command", required=True, metavar="COMMAND"), commands)
    return parser


@functools.cache
def _table() -> dict[str, Any]:
    """Commands and shared options by name, as the head of their file explains."""
    return tomllib.loads(Path(__file__).with_name("commands.toml").read_text(encoding="utf-8"))


def _add_commands(group: Any, commands: Mapping[str, Any], before: str = "") -> None:
    for name, one in commands.items():
        text = one["about"]
        made = group.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        _add_options(made, one.get("options", {}))
        if before:
            made.set_defaults(command=f"{before}_{name}")
        if "formats" in one:
            formats = made.add_subparsers(dest="format", required=True, metavar="FORMAT")
            _add_commands(formats, one["formats"], name)
        else:
            quiet_option(made)


def _add_options(parser: argparse.ArgumentParser, options: Mapping[str, Any]) -> None:
    groups: dict[str, Any] = {}
    for form, given in options.items():
        if form in _OF_RUNTIME:
            _OF_RUNTIME[form](parser)
            continue
        if form.startswith("@"):
            _add_options(parser, _table()[form])
            continue
        more = {"help": given} if isinstance(given, str) else dict(given)
        if "help" in more:
            more["help"] = more["help"].format_map(_SLOTS)
        if "type" in more:
            more["type"] = {"int": int, "float": float}[more["type"]]
        words = form.split(" ")
        names = [word for word in words if word.startswith("-")] or words[:1]
        if len(words) > len(names):
            more["metavar"] = " ".join(words[len(names) :])
        elif "metavar" in more:
            more["metavar"] = tuple(more["metavar"])
        target: Any = parser
        if group := more.pop("group", ""):
            if group not in groups:
                groups[group] = parser.add_mutually_exclusive_group()
            target = groups[group]
        target.add_argument(*names, **more)


def prove_options(prove: argparse.ArgumentParser) -> None:
    """Options of `rulec prove`, the same for the suite that it starts."""
    _add_options(prove, _table()["prove"]["options"])


if __name__ == "__main__":
    raise SystemExit(main())
