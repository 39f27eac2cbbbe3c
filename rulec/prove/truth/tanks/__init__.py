"""Independent truth for plants that store liquid: tanks in a row, written from physics.

It shares no code with the packages it tests. Files in order of data flow: `laws.yaml` and `plant`
(numbers of parts in their laws), `drive` (inputs), `balance` (levels over time), `sensing`
(voltages), `build` (true parameters by seed, difficulties), `effects.yaml` and `effect` (also its
right names), `effect_size`, `detection_limit`, `rows` (random plants, their files), `plan` (a case
and its answer), `suite`. All is in cm, s and V.
"""
