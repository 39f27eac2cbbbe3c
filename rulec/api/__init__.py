"""What `import rulec` offers: the commands as functions, with results as values.

Each function takes paths or data frames and returns a frozen result with `to_dict()`, `to_frame()`
and a display for notebooks and terminals. The commands are a layer on top.
"""
