"""Real recordings in a plain form, asked and scored: `rulec prove --real DIR`.

Files in order of data flow: `make` (rigs from recipes), `form` (read and check a folder of rigs),
`hide` (the same rig under other names), `ask` (the tool, as a user runs it), `score`, `told`
(terminal, JSON, page) and `command`. `schema` holds the forms of the files.
"""
