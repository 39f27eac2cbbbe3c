"""The start and end of every command: options, streams, threads, messages about mistakes.

Only the standard library at the top: `--help` answers without numpy. Commands are imported when
they are called: those of the runtime must start without sympy.
"""

import argparse
import io
import os
import re
import sys
import tomllib
from argparse import SUPPRESS
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn


class Parser(argparse.ArgumentParser):
    """A parser that shows wrong arguments as plain text: a script may pass anything."""

    def parse_args(self, arguments: Any = None, namespace: Any = None) -> Any:
        """Parse arguments, and keep them as `words`; without any, print the help and exit as for
        wrong usage."""
        given = sys.argv[1:] if arguments is None else arguments
        if not given:
            self.print_help(sys.stderr)
            self.exit(2)
        found = super().parse_args(given, namespace)
        found.words = list(given)
        return found

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse unknown arguments with the usage of their own command."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            from rulec_runtime.output.nearest import nearest

            known = (name.lstrip("-") for name in self._option_string_actions)
            near = nearest(unknown[0].partition("=")[0].lstrip("-"), known)
            hint = f"; did you mean '--{near}'?" if near else ""
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        from rulec_runtime.output.terminal import one_line

        super().error(_with_the_nearest(one_line(message)))


def _with_the_nearest(message: str) -> str:
    """The message, with the most similar allowed word instead of all of them."""
    found = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message)
    if found is None:
        return message
    from rulec_runtime.output.nearest import nearest

    near = nearest(found[1], re.findall(r"[\w-]+", found[2]))
    if near is None:
        return message
    return f"{message[: found.start()]}there is no '{found[1]}'; did you mean '{near}'?"


def prepare_process() -> None:
    """Replace symbols that a terminal lacks, and use one thread for linear algebra.

    Matrices are small: on a busy machine, threads that wait for each other cost several times what
    they save.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


class Commands:
    """The commands of a program and their options, from a TOML file whose head explains it.

    Parameters
    ----------
    own : file of the program.
    shared : file of another program, whose shared options `own` may use as well.
    """

    def __init__(self, own: Path, shared: Path | None = None) -> None:
        self._table = tomllib.loads(own.read_text(encoding="utf-8"))
        self._shared = {} if shared is None else Commands(shared)._table

    def parser(self) -> Parser:
        """The parser of all commands."""
        program = self._table["program"]
        parser = Parser(**program)
        parser.add_argument("--version", action=Version, distribution=program["prog"])
        commands = {name: one for name, one in self._table.items() if "about" in one}
        group = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
        self._add_commands(group, commands)
        return parser

    def _add_commands(self, group: Any, commands: Mapping[str, Any], before: str = "") -> None:
        for name, one in commands.items():
            text = one["about"]
            made = group.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
            self._add(made, one.get("options", {}))
            if before:
                made.set_defaults(command=f"{before}_{name}")
            if "formats" in one:
                formats = made.add_subparsers(dest="format", required=True, metavar="FORMAT")
                self._add_commands(formats, one["formats"], name)
            else:
                quiet_option(made)

    def _add(self, parser: argparse.ArgumentParser, options: Mapping[str, Any]) -> None:
        groups: dict[str, Any] = {}
        for form, given in options.items():
            if form.startswith("@"):
                self._add(parser, self._table.get(form) or self._shared[form])
                continue
            more = {"help": given} if isinstance(given, str) else dict(given)
            if "help" in more:
                more["help"] = more["help"].format_map(self._table.get("slots", {}))
            if "type" in more:
                more["type"] = _TYPES[more["type"]]
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


def quiet_option(parser: argparse.ArgumentParser) -> None:
    """Add the option `--quiet` of every command."""
    parser.add_argument(
        "-q", "--quiet", action="store_true", help="print only requested results and errors"
    )


def run_command(options: argparse.Namespace, package: str, program: str) -> int:
    """Run the file of a command and return its exit code; mistakes of the user become messages,
    bugs do not."""
    from rulec_runtime.output.terminal import say_aside

    try:
        code = int(import_module(f"{package}.commands.{options.command}").run(options))
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        say_aside("rulec: interrupted")
        return 130
    except BrokenPipeError:
        # The reader of a pipe has gone (`rulec ... | head`): no message, and no flush at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        code, text = _mistake(error, f"{program} {options.command.replace('_', ' ')}")
        if not code:
            raise
        say_aside(text)
        return code


def _mistake(error: Exception, name: str) -> tuple[int, str]:
    """Exit code and message for a mistake of the user; the code is 0 for any other error."""
    from rulec_runtime.output.refusal import Misused, Refusal
    from rulec_runtime.output.terminal import one_line

    if isinstance(error, Refusal):
        return 1, error.for_terminal()
    if isinstance(error, Misused):
        return 2, one_line(f"{name}: {error}")
    if isinstance(error, OSError):
        return 1, one_line(f"rulec: {error.filename or 'file'}: {error.strerror or error}")
    return 0, ""


class Version(argparse.Action):
    """Prints the version of a distribution and exits; looks it up only then."""

    def __init__(self, option_strings: Sequence[str], dest: str, **rest: Any) -> None:
        self._distribution = str(rest.pop("distribution"))
        super().__init__(option_strings, dest, nargs=0, help="show the version", default=SUPPRESS)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        from rulec_runtime.output.terminal import write_machine_text

        write_machine_text(f"{self._distribution} {version(self._distribution)}\n")
        parser.exit()


def _choice(*choices: str) -> Callable[[str], tuple[str, ...]]:
    def chosen(text: str) -> tuple[str, ...]:
        names = tuple(name.strip() for name in text.split(","))
        if wrong := [name for name in names if name not in choices]:
            raise argparse.ArgumentTypeError(f"{wrong[0]!r} is none of {', '.join(choices)}")
        return names

    return chosen


def _time(text: str) -> float:
    """Seconds: a number, or a date as s since 1970."""
    from datetime import UTC, datetime
    from math import isfinite

    try:
        seconds = float(text)
    except ValueError:
        try:
            date = datetime.fromisoformat(text)
            seconds = (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
        except (ValueError, OverflowError):
            seconds = float("nan")
    if not isfinite(seconds):
        raise argparse.ArgumentTypeError(f"{text!r} is neither seconds nor a date")
    return seconds


_TYPES: Mapping[str, Callable[[str], Any]] = {
    "int": int,
    "float": float,
    "time": _time,
    "kinds": _choice("fault", "sensor", "regime", "unknown", "blind", "source"),
    "statuses": _choice(*"FCSM"),
}
"""The types of values that a file of commands may name."""
