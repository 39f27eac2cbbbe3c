"""A share that was counted."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Share:
    """`count` out of `of`."""

    count: int
    of: int

    @property
    def value(self) -> float:
        """The share; not a number of nothing."""
        return self.count / self.of if self.of else float("nan")

    def form(self) -> dict[str, Any]:
        """Machine form; null for a share of nothing."""
        value = round(self.value, 6) if self.of else None
        return {"count": self.count, "of": self.of, "value": value}
