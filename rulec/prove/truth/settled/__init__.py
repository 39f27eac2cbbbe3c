"""Independent truth of stationary plants for the proof, written from physics.

Shares no code with the packages it tests. Files in order of data flow: `pumps`, `term` (what acts
beyond plain laws), `rig` (the plant), `solve` (its operating points), `rigs` (plants that are
drawn), `drive`, `scene` (a plant and how it is run), `effect` and files of effects, `effects`,
`key.yaml` (what the catalogue calls them), `visible` (how much can be seen at best; `blurred`: of
hard cases), `sized`, `rivals`, `answer`, `folder`, `reference` (the true
model on held-out samples), `plan` (a case), `suite`.
"""
