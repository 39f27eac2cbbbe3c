"""Independent truth for plants that store liquid: tanks in a row, written from physics.

It shares no code with the packages it tests. Files in order of data flow: `plant`, `laws` (flows),
`balance` (levels over time), `sensing` (voltages), `drive` (inputs), `build` (true parameters by
seed), `effect` and the three files of effects, `effects` (all by id), `size` (of an effect),
`case`, `folder`, `key` (right answers), `knobs` (parameters), `step`, `model` (the true plant as a
model), `seen` (the limit of detection), `refit`, `sealed` (common form), `suite` (with random
plants). Of hard cases: `bend` (a form error), `hard` (difficulties), `blurred`. All is in cm, s
and V.
"""

from .build import CASCADED, Layout, build
from .case import Case, case
from .effects import possible_effects

__all__ = ["CASCADED", "Case", "Layout", "build", "case", "possible_effects"]
