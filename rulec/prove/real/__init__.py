"""The tool on real recordings in a plain form, scored: `rulec prove --real DIR`.

Files in order of data flow: `make` (rigs from recipes), `rig_folder` (read and check a rig),
`renamed_rig` (the same under other names), `run_tool` (as a user does), `score`, `score_table`
(terminal, JSON, page) and `command`. `schema` has the forms of the files.
"""
