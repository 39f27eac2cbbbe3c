"""The long run, measured, as JSON: `python -m tests.rig.long_run [rows|courses|pairs|year...]`."""

import argparse
import json

from tests.rig.long_run import courses, pairs, rows, year

ASKED = {module.__name__.rpartition(".")[2]: module for module in (rows, courses, pairs, year)}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.rig.long_run", description=__doc__)
    parser.add_argument("questions", nargs="*", metavar="QUESTION", help=", ".join(ASKED))
    questions = parser.parse_args().questions or ASKED
    if strangers := set(questions) - set(ASKED):
        parser.error(f"no question {', '.join(sorted(strangers))}")
    print(json.dumps({name: ASKED[name].measure() for name in questions}, indent=1))


if __name__ == "__main__":
    main()
