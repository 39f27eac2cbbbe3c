"""Command: make cases of tanks with a known truth, `python -m rulec.prove.truth.tanks write`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from time import perf_counter

from .build import CASCADED, LAYOUTS
from .case import Case, case
from .cases import CLEAN, GROUPS, named
from .effects import possible_effects
from .folder import plant_folder


def main(arguments: list[str] | None = None) -> None:
    """Run one subcommand."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        match options.command:
            case "effects":
                for id_, placed in possible_effects(LAYOUTS[options.plant]).items():
                    print(f"{placed.effect.sort:8} {id_:24} {placed.effect.title}")
            case "one":
                layout = LAYOUTS[options.plant]
                made = case(options.seed, options.effects, options.samples, layout)
                _write(options.out, made)
            case _:
                _write_all(options)
    except ValueError as problem:
        parser.error(str(problem))


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m rulec.prove.truth.tanks", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    effects = commands.add_parser("effects", help="list the effects of a plant")
    one = commands.add_parser("one", help="write one case with chosen effects")
    one.add_argument("effects", nargs="*", help="such as upper.leak or lower.y.clipping")
    one.add_argument("--seed", type=int, default=1)
    for command in (effects, one):
        command.add_argument("--plant", choices=sorted(LAYOUTS), default=CASCADED.name)
    every = commands.add_parser("write", help="write all named cases")
    every.add_argument("--rounds", type=int, default=1)
    every.add_argument("--clean", type=int, default=1, help="multiple of the clean cases")
    every.add_argument("--groups", nargs="+", choices=GROUPS, default=list(GROUPS))
    for command in (one, every):
        command.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
        command.add_argument("--samples", type=int, default=1024)
    return parser


def _write(folder: Path, made: Case) -> None:
    """Write a case; its plant's folder is put beside it when it is the first one."""
    if not (folder / made.answer.plant).exists():
        plant_folder(made.setup.layout, folder)
    print(made.write(folder), made.answer.digest)


def _write_all(options: Namespace) -> None:
    clean = {name: count * options.clean for name, count in CLEAN.items()}
    for one in named(options.rounds, clean, tuple(options.groups)):
        begin = perf_counter()
        made = one.make(options.samples)
        _write(options.out, made)
        shown = " ".join(f"{name} {value:.2f} V" for name, value in made.answer.shown.items())
        print(f"  {perf_counter() - begin:.1f} s, attempt {made.answer.attempt}: {shown}")


if __name__ == "__main__":
    main()
