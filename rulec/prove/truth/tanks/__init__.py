"""Independent truth for plants that store liquid: tanks in a row, written from physics.

Shares no code with the packages it tests. Files in order of data flow: `plant` (what is built),
`laws` (flows), `balance` (levels over time), `sensing` (voltages), `drive` (inputs), `build` (true
parameters by seed), `effect` and the three files of effects, `effects` (all by id), `size` (how
large an effect is made), `case`, `rows` (plants drawn), `folder`, `key` (what is right), `knobs`,
`step`, `model` (the true plant as a model), `seen` (what can be seen at best), `refit`, `sealed`
(common form), `suite`. Of hard cases: `bend` (a form error), `hard` (what is drawn), `blurred`.
All is in cm, s and V.
"""

from .build import CASCADED, Layout, build
from .case import Case, case
from .effects import possible_effects

__all__ = ["CASCADED", "Case", "Layout", "build", "case", "possible_effects"]
