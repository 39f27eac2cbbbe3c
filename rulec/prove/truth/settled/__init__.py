"""Independent truth of stationary plants for the proof, written from physics.

It shares no code with the packages it tests. Files in order of data flow: `pumps.yaml`, `rig` (the
plant), `solve` (its operating points, and terms beyond plain laws), `rigs` (random plants),
`drive`, `difficulty`, `operated_plant`, `effects.yaml`, `effect`, `detection_limit`, `effect_size`,
`plan` (a case and its answer), `further_recording`, `suite`.
"""
