"""Independent truth for plants that store liquid: tanks in a row, written from physics.

It shares no code with the packages it tests. Files in order of data flow: `feed` and `plant`,
`laws` (flows), `balance` (levels over time), `sensing` (voltages), `drive` (inputs), `build` (true
parameters by seed, difficulties), `effects.yaml`, `effect`, `effect_size`, `right_answer`,
`detection_limit`, `rows` (random plants, their files),
`plan` (a case and its answer), `suite`. All is in cm, s and V.
"""
