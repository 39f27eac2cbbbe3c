"""Python source without what computes nothing: comments, docstrings, empty lines.

By characters, not by Python's own parser: what that gives differs from version to version, and a
hash in the ledger must not.
"""

from __future__ import annotations

import re

_TOKEN = re.compile(
    r"""
    (?P<text>[a-zA-Z]{0,2}(?:\"{3}(?:\\.|[^\\])*?\"{3}|'{3}(?:\\.|[^\\])*?'{3}
              |"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'))
    |(?P<comment>\#[^\n]*)
    |(?P<open>[(\[{])|(?P<close>[)\]}])
    |(?P<line>\n)
    |(?P<word>\w+)
    |(?P<blank>[ \t\f\r]+)
    """,
    re.VERBOSE | re.DOTALL,
)
_BARE = re.compile(r"[ \t]*$")


def plain_code(source: str) -> str:
    """The source without comments, without strings that are statements, and without empty lines."""
    out: list[str] = []
    line: list[str] = []
    depth, at = 0, 0

    def end() -> None:
        text = "".join(line).rstrip()
        if text:
            out.append(text)
        line.clear()

    for token in _TOKEN.finditer(source):
        line.append(source[at : token.start()])
        at = token.end()
        match token.lastgroup:
            case "comment":
                continue
            case "line":
                end()
                continue
            case "open":
                depth += 1
            case "close":
                depth -= 1
            case "text" if depth == 0 and _is_statement(source, token, line):
                continue
        line.append(token.group())
    line.append(source[at:])
    end()
    return "\n".join(out) + "\n"


def _is_statement(source: str, token: re.Match[str], before: list[str]) -> bool:
    """Whether a string stands alone on its lines."""
    after = source[token.end() :].partition("\n")[0] if token.end() < len(source) else ""
    alone = not after.strip() or after.lstrip().startswith("#")
    return alone and not "".join(before).strip()
