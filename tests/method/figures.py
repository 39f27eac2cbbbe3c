"""Print the measured figures behind the bounds of the tests: `python -m tests.method.figures`."""

from __future__ import annotations

from tests.method.test_isolation import rates
from tests.method.test_replay import SEEDS, figures

ASKED = {
    "abc": frozenset[str](),
    "abc-membrane": frozenset[str](),
    "abc-centrifugal": frozenset({"A.dp.high"}),
}
"""Plants, and faults left out (a centrifugal pump has no flow above its shut-off pressure)."""


def main(seeds: int = 100) -> None:
    """Leakage replay, then isolation rates."""
    print(f"leakage replay, {len(SEEDS)} seeds")
    for name, value in figures().items():
        print(f"  {name:26}{value:9.4f}")
    for plant, skip in ASKED.items():
        print(f"{plant}, {seeds} seeds per fault")
        for degree in (0.1, 0.2, 0.3):
            found = vars(rates(plant, degree, seeds, skip))
            print(f"  {degree}  " + "  ".join(f"{name} {v:.3f}" for name, v in found.items()))


if __name__ == "__main__":
    main()
