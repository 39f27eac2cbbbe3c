"""Independent truth for plants that store liquid: tanks in a row, written from physics.

It shares no code with the packages it tests. Files in order of data flow: `feed` and `plant`,
`laws` (flows), `balance` (levels over time), `sensing` (voltages), `drive` (inputs), `build` (true
parameters by seed, difficulties), `effects.yaml`, `effect`, `case` (with sized effects),
`right_answer`, `model` (the true plant as a model, and its fit), `detection_limit`, `sealed` (the
common form), `suite` (with random plants). All is in cm, s and V.
"""

from .build import CASCADED, Layout, build
from .case import Case, case
from .effect import possible_effects

__all__ = ["CASCADED", "Case", "Layout", "build", "case", "possible_effects"]
