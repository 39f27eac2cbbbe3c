"""Independent truth for plants that store liquid: tanks in a row, written from physics.

Shares no code with the packages it tests. Files in order of data flow: `plant` (what is built),
`laws` (flows), `balance` (levels over time), `sensing` (voltages), `drive` (inputs), `build` (true
parameters by seed), `effect` and the four files of effects, `effects` (all by id), `size` (how
large an effect is made), `answer`, `describe`, `case`, `cases` (the list), `folder`, `__main__`.
For the proof: `rows` (plants drawn), `key` (what is right), `knobs`, `step`, `model` (the true
plant as a model), `seen` (what can be seen at best), `refit`, `sealed` (common form), `suite`.
All is in cm, s and V.
"""

from .answer import Answer, Truth
from .build import CASCADED, LAYOUTS, ROW, Layout, build
from .case import Case, case
from .cases import GROUPS, Named, named
from .effects import possible_effects
from .folder import plant_folder

__all__ = [
    "CASCADED",
    "GROUPS",
    "LAYOUTS",
    "ROW",
    "Answer",
    "Case",
    "Layout",
    "Named",
    "Truth",
    "build",
    "case",
    "named",
    "plant_folder",
    "possible_effects",
]
