"""The start and end of every command: options, streams, threads, messages about mistakes.

Only the standard library at the top: `--help` answers without numpy.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import sys
from argparse import SUPPRESS
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

RECORDING = (
    "file (CSV, Parquet, Excel, MAT, MDF, TDMS, HDF5), FILE#TABLE for one table of it, a folder of "
    "files, or - for standard input"
)
"""A recording, in the help of a command."""

RULESET = "file that rulec compile wrote"
MODE = "default: whole signature with uncertainties; paper: Eqs. 17-19 as printed"


class Parser(argparse.ArgumentParser):
    """A parser that shows wrong arguments as plain text: a script may pass anything."""

    def parse_args(self, arguments: Any = None, namespace: Any = None) -> Any:
        """Parse arguments; without any, print the help and exit as for wrong usage."""
        given = sys.argv[1:] if arguments is None else arguments
        if not given:
            self.print_help(sys.stderr)
            self.exit(2)
        return super().parse_args(given, namespace)

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


def carried_out(run: Callable[[], int], name: str) -> int:
    """Run a command and return its exit code; mistakes of the user become messages, bugs do not."""
    try:
        code = run()
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        _say("rulec: interrupted")
        return 130
    except BrokenPipeError:
        # The reader of a pipe has gone (`rulec ... | head`): no message, and no flush at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        code, text = _mistake(error, name)
        if not code:
            raise
        _say(text)
        return code


def _say(message: str) -> None:
    from rulec_runtime.output.terminal import say_aside

    say_aside(message)


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


def version_option(parser: argparse.ArgumentParser, distribution: str) -> None:
    """Add the option `--version`."""
    parser.add_argument("--version", action=Version, distribution=distribution)


def quiet_option(parser: argparse.ArgumentParser) -> None:
    """Add the option `--quiet` of every command."""
    parser.add_argument(
        "-q", "--quiet", action="store_true", help="print only requested results and errors"
    )


def diagnose_options(diagnose: argparse.ArgumentParser, plant: str, about: str = RULESET) -> None:
    """Add the options of `diagnose`; `plant` is its first argument, and `about` says what it is."""
    add = diagnose.add_argument
    add("plant", metavar=plant, help=about)
    add(
        "recording",
        metavar="RECORDING",
        help=f"{RECORDING}; or results of observers in the modules' controllers",
    )
    add("--mode", choices=("default", "paper"), default="default", help=MODE)
    add("--trace", metavar="FILE.csv", help="one row per sample; - for standard output")
    add("--report", metavar="FILE.html", help="one page with pictures, to hand on")
    add("--truth", metavar="FILE.csv", help="true degrees, for comparison in the report")
    json_option(diagnose)


def watch_options(watch: argparse.ArgumentParser, plant: str, about: str = RULESET) -> None:
    """Add the options of `watch`; `plant` is its first argument, and `about` says what it is."""
    add = watch.add_argument
    add("plant", metavar=plant, help=about)
    add(
        "--source",
        metavar="SOURCE",
        required=True,
        help="a CSV file that grows, - for standard input, opc.tcp://HOST:PORT, mqtt://HOST",
    )
    add("--map", metavar="MAP.yaml", help="node or topic of each signal (OPC UA, MQTT)")
    add("--state", metavar="FILE", help="saved state, to resume from after a restart")
    add(
        "--journal",
        metavar="JOURNAL",
        help="keep events and state in one database: a file (SQLite), or postgresql+psycopg://...",
    )
    add(
        "--page",
        metavar="[HOST:]PORT",
        help="serve a web page; other machines need the token in RULEC_TOKEN",
    )
    add("--events", metavar="FILE.jsonl", help="append each event as one line of JSON")
    add(
        "--mqtt",
        metavar="URL",
        help="send events and status to a broker: mqtt://HOST or mqtts://HOST, with /TOPIC to "
        "replace /rulec; user and password from RULEC_MQTT_USER, RULEC_MQTT_PASSWORD",
    )
    add("--mqtt-ca", metavar="FILE", help="CA file for mqtts://, instead of the system's")
    add(
        "--device-health",
        metavar="[HOST:]PORT",
        help="publish the health of each module by OPC UA (IDeviceHealthType); other machines need "
        "certificates",
    )
    add(
        "--device-health-certificates",
        metavar="FOLDER",
        help="folder with own.der, own.pem, and the certificates of clients in trusted",
    )
    add(
        "--waiting",
        metavar="FOLDER",
        help="where events wait while database or broker are unreachable or a disk is full "
        "(default: the folder of the journal, the state or the events)",
    )
    add("--until-end", action="store_true", help="stop at the end of a file instead of waiting")
    add(
        "--fail-on",
        metavar="LETTERS",
        default="",
        help="exit code 3 if one of these letters of NE 107 is active at the end, as in F,C",
    )


def json_option(parser: argparse.ArgumentParser) -> None:
    """Add the option `--json`."""
    parser.add_argument("--json", metavar="FILE", help="result as JSON; - for standard output")


def journal_options(journal: argparse.ArgumentParser) -> None:
    """Add the options of `journal`."""
    add = journal.add_argument
    add("journal", metavar="JOURNAL", help="file, or postgresql+psycopg://USER@HOST/DATABASE")
    add("--plant", metavar="P", help="one plant only")
    when = "seconds, or a date such as 2026-11-25T14:30 (UTC unless it names a zone)"
    add("--since", metavar="T", type=_time, help=f"from then on: {when}")
    add("--until", metavar="T", type=_time, help="up to then")
    add(
        "--kind",
        metavar="K",
        type=_choice("fault", "sensor", "regime", "unknown", "blind", "source"),
        default=(),
        help="fault, sensor, regime, unknown, blind or source; several with commas",
    )
    letters = "letters of NE 107, such as F,C,S,M"
    add("--status", metavar="S", type=_choice(*"FCSM"), default=(), help=letters)
    add("--active", action="store_true", help="active episodes only")
    add("--csv", metavar="FILE", help="a table as CSV; - for standard output")
    json_option(journal)
    add("--ack", metavar="EPISODE", help="acknowledge an episode; needs --by")
    add("--by", metavar="NAME", help="who acknowledges")
    add(
        "--fail-on",
        metavar="S",
        type=_choice(*"FCSM"),
        default=(),
        help=f"exit code 3 if an active episode has one of these statuses: {letters}",
    )


def _choice(*known: str) -> Callable[[str], tuple[str, ...]]:
    def chosen(text: str) -> tuple[str, ...]:
        names = tuple(name.strip() for name in text.split(","))
        if wrong := [name for name in names if name not in known]:
            raise argparse.ArgumentTypeError(f"{wrong[0]!r} is none of {', '.join(known)}")
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
