"""Print all figures: `python -m tests.rig.mismatch [zema hsy esp clean speed stores]`."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain
from pathlib import Path

from rich.console import Console

from rulec.prove.partition import DYNAMIC_FULL
from tests.conftest import recordings_folder
from tests.rig.mismatch import clean, esp, hsy, speed, stores, zema
from tests.rig.mismatch.ask import Answer, Failed, ask, exists
from tests.rig.mismatch.case import Case
from tests.rig.mismatch.show import show_answers, show_lines

NEEDED = ("mismatch", "simulate", "adopt")

Answers = list[tuple[Case, Answer | str]]


def main() -> None:
    """Run the experiments one after the other."""
    parser = argparse.ArgumentParser(prog="python -m tests.rig.mismatch", description=__doc__)
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help=", ".join(EXPERIMENTS))
    parser.add_argument("--seeds", type=int, default=200, help="clean recordings (default 200)")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--keep", metavar="FOLDER", type=Path, help="leave all files there")
    options = parser.parse_args()
    if strangers := set(options.experiments) - set(EXPERIMENTS):
        parser.error(f"no experiment {', '.join(sorted(strangers))}")
    if absent := [name for name in NEEDED if not exists(name)]:
        parser.error(f"this rulec has no command {', '.join(absent)} yet")
    out = Console(width=160)
    with tempfile.TemporaryDirectory() as temporary:
        work: Path = options.keep or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        for name in options.experiments or EXPERIMENTS:
            out.rule(name)
            EXPERIMENTS[name](out, work, options)


def _zema(out: Console, work: Path, options: argparse.Namespace) -> None:
    folder = recordings_folder()
    for case, answer in _asked(out, zema.prepare(folder, work), work):
        if isinstance(answer, str):
            continue
        if case.name == "zema full":
            found = zema.fault_periods(answer, folder)
            lines = [
                f"{what}: precision {h.precision:.3f}, recall {h.recall:.3f} "
                f"({h.both} of {h.said} said, of {h.true} true cycles)"
                for what, h in found.items()
            ]
            show_lines(out, "periods against labels", lines)
        if "without temperatures" in case.name:
            likeness = zema.driver_likeness(answer, folder)
            show_lines(out, "hidden driver", [f"correlation with TS1: {likeness:.3f}"])
        elif "without" not in case.name and case.name != "zema leak-free":
            _repaired(out, case, partial(zema.repair_lines, case, answer, folder, work))


def _hsy(out: Console, work: Path, options: argparse.Namespace) -> None:
    for case, answer in _asked(out, hsy.prepare(recordings_folder(), work), work):
        if not isinstance(answer, str):
            _repaired(out, case, partial(hsy.repair_lines, case, answer, work))


def _esp(out: Console, work: Path, options: argparse.Namespace) -> None:
    for case, answer in _asked(out, esp.prepare(recordings_folder(), work), work):
        if not isinstance(answer, str):
            _repaired(out, case, partial(esp.repair_lines, case, answer, work))


def _clean(out: Console, work: Path, options: argparse.Namespace) -> None:
    found = list(clean.answers(options.seeds, work, options.workers))
    verdicts: dict[str, int] = {}
    for _, answer in found:
        word = "failed" if isinstance(answer, str) else answer.verdict
        verdicts[word] = verdicts.get(word, 0) + 1
    show_lines(out, "verdicts on clean recordings", [str(verdicts)])
    wrong = [(c, a) for c, a in found if isinstance(a, str) or a.verdict != "none"]
    if wrong:
        show_answers(out, wrong[:10])


def _speed(out: Console, work: Path, options: argparse.Namespace) -> None:
    clean_ = speed.timed(speed.prepare(work), work)
    show_answers(out, [(clean_.case, clean_.answer)])
    show_lines(out, "growth", speed.growth_lines(chain([clean_], speed.growth(work))))


def _stores(out: Console, work: Path, options: argparse.Namespace) -> None:
    found = list(stores.verdicts(work, {"clean": options.seeds}))
    wrong = [
        f"{planted}: {verdict}, {told}" for planted, verdict, told in found if verdict != "none"
    ]
    show_lines(out, "clean", [f"{len(found)} recordings, {len(wrong)} claims", *wrong])
    if not options.quick:
        count = {group: n for group, n in DYNAMIC_FULL.items() if group != "clean"}
        planted = stores.verdicts(work, count)
        show_lines(out, "planted", [" | ".join(row) for row in planted])


EXPERIMENTS: dict[str, Callable[[Console, Path, argparse.Namespace], None]] = {
    "zema": _zema,
    "hsy": _hsy,
    "esp": _esp,
    "clean": _clean,
    "speed": _speed,
    "stores": _stores,
}


def _asked(out: Console, cases: Sequence[Case], work: Path) -> Answers:
    """Ask about each case and show the answers; a failure is shown as such."""
    answers: Answers = []
    for case in cases:
        try:
            answers.append((case, ask(case, work)))
        except Failed as failure:
            answers.append((case, str(failure)))
    show_answers(out, answers)
    return answers


def _repaired(out: Console, case: Case, measure: Callable[[], list[str]]) -> None:
    """What the adopted plant does on unseen data; a failure is shown as such."""
    try:
        lines = measure()
    except Failed as failure:
        lines = [f"failed: {failure}"]
    show_lines(out, f"{case.name}: repaired plant on unseen data", lines)


if __name__ == "__main__":
    main()
