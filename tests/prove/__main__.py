"""`python -m tests.prove`: the command, or what it lacks where only the product is installed."""

from __future__ import annotations

import sys
from importlib.util import find_spec

NEEDS = ("pytest", "sklearn", "pysindy")
"""What the suite imports, some of it only at its end, beside what the product needs."""


def main() -> int:
    """Run the command; 1 where packages of the suite are absent."""
    absent = [name for name in NEEDS if find_spec(name) is None]
    if absent:
        sys.stderr.write(
            f"rulec prove: {', '.join(absent)} not installed here; `make test` installs all that "
            "the suite needs, as does: pip install -e ./runtime -e '.[dev]'\n"
        )
        return 1
    from tests.prove import command

    return command.main()


if __name__ == "__main__":
    raise SystemExit(main())
