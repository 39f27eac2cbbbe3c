"""One file per command, and what `import rulec` offers: the commands as functions.

Each function takes paths or data frames and returns a frozen result with `to_dict()`, `to_frame()`
and a display for notebooks and terminals. `run` of a file is the command around it.
"""
