"""The tool on real recordings in a plain form, scored: `rulec prove --real DIR`.

Files in order of data flow: `make` (rigs from recipes), `form` (read and check a folder of rigs),
`hide` (the same rig under other names), `ask` (run the tool as a user does), `score`, `told`
(terminal, JSON, page) and `command`. `schema` has the forms of the files.
"""
