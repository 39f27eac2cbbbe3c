"""Check the regimes of a module type: comparisons over its signals, parameters and definitions."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from rulec.knowledge.module_type import Comparison, Regime, Signal
from rulec.language.document import Path_
from rulec.language.expression import Rejected, parse
from rulec.language.reader import Reader

MINIMUM = "minimum"
"""In a comparison: the smallest reading at which the equations hold."""


@dataclass
class RegimeReader(Reader):
    """Reads the regimes of one module document; `known` are the names they may use."""

    signals: Mapping[str, Signal]
    known: Collection[str]

    def regimes(self) -> dict[str, Regime]:
        """All regimes by name."""
        found = {}
        for name, part in self.document.data.get("regimes", {}).items():
            path: Path_ = ("regimes", name)
            compared = (self._comparison((*path, "when", i)) for i in range(len(part["when"])))
            found[name] = Regime(
                name=name,
                title=part["title"],
                when=tuple(c for c in compared if c is not None),
                status=part["status"],
                text=part["text"],
                action=part["action"],
                origin=self.origin(*path, source=part["source"]),
            )
        return found

    def _comparison(self, path: Path_) -> Comparison | None:
        """A comparison such as ``loss < 0``; a mistake is reported and gives None."""
        text: str = self.part(path)
        sign = ">" if ">" in text else "<"
        left, _, right = text.partition(sign)
        if right.strip() == MINIMUM:
            return self._with_minimum(path, text, left.strip(), above=sign == ">")
        sides = []
        for side, shift in ((left, 0), (right, len(left) + 1)):
            try:
                expression = parse(side)
            except Rejected as error:
                self.report_error(path, error, shift)
                return None
            before = len(self.found)
            what = "signal, parameter nor definition of this module"
            self.check_names(path, expression, self.known, what, shift)
            self.check_own(path, expression, "a regime", "give it a definition", shift)
            if len(self.found) > before:
                return None
            sides.append(side.strip())
        more, less = sides if sign == ">" else sides[::-1]
        return Comparison(text, parse(f"({more}) - ({less})"))

    def _with_minimum(self, path: Path_, text: str, name: str, *, above: bool) -> Comparison | None:
        signal = self.signals.get(name)
        if signal is None or signal.minimum is None:
            message = f"'{name}' is no signal of this module with a minimum"
            self.report(path, "KB126", message, "give the signal a 'minimum'")
            return None
        return Comparison(text, parse("0"), name, above)
