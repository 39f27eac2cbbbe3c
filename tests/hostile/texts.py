"""Texts that steer a terminal, break markup, or run in a spreadsheet."""

STEERING = {
    "escape": "\x1b[2J\x1b[31m",
    "title of the window": "\x1b]0;owned\x07",
    "C1": "\x9b31m",
    "delete": "\x7f\x08\x08",
    "right to left": "\u202eok\u202c",
    "isolate": "\u2066x\u2069",
    "line separator": "a\u2028b",
    "carriage return": "bad\rok",
}
"""Characters that a terminal obeys, or that turn its text around."""

CANARY = "hunter2canary"

SECRETS = {
    "a list of users": f"root:x:0:0:{CANARY}:/root:/bin/sh\ndaemon:{CANARY}:1:1::/:/bin/sh\n",
    "YAML of others": f"{CANARY}: 1\npassword: {CANARY}\n{CANARY}: 2\n",
    "broken YAML": f"{CANARY}: !!{CANARY} 1e999\n{CANARY}: &{CANARY} [{CANARY}\n",
    "a table": f"time,{CANARY}\n{CANARY},{CANARY}\n{CANARY},1\n",
    "JSON": f'{{"{CANARY}": "{CANARY}", "a": [1, 2]}}\n',
}
"""Files that are none of this tool; nobody should read in a message what stands in them."""

ESCAPED = {
    "escape": r"\e[2J",
    "hex": r"\x1b[31m",
    "C1": r"\x9b31m",
    "null": r"\0",
    "bell": r"\a",
    "right to left": r"\u202eok",
    "isolate": r"\u2066x",
    "surrogate": r"\ud800",
    "line separator": r"\u2028",
    "backspace": r"ok\b\b",
}
"""The same as YAML writes them in double quotes."""

MARKUP = ["[/x]", "[/]", "[bold", "[link=file:///etc/passwd]x[/link]", "[red]ok[/red]", "\\[/x]\\"]

FORMULAS = ["=1+1", "+1+cmd", "-2+3+cmd|' /C calc'!A0", "@SUM(A1)", "\t=1", '=HYPERLINK("x")']
