"""Independent truth of stationary plants for the proof, written from physics.

It shares no code with the packages it tests. Files in order of data flow: `pumps`, `term` (terms
beyond plain laws), `rig` (the plant), `solve` (its operating points), `rigs` (random plants),
`drive`, `scene` (a plant and its operation), `effect` and files of effects, `effects`, `key.yaml`
(their names in the catalogue), `visible` (the limit of detection; `blurred`: of hard cases),
`sized`, `rivals`, `answer`, `folder`, `reference` (the true model on held-out samples), `plan` (a
case), `suite`.
"""
