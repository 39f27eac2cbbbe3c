"""The page of `import rulec`: directives, from which mkdocstrings makes the text of docstrings."""

from __future__ import annotations

import rulec


def python_page() -> str:
    """Markdown with a section per name that `import rulec` offers: functions, results, refusals."""
    names = rulec.__all__
    groups = {
        "Functions": [n for n in names if n.islower()],
        "Results": [n for n in names if n.endswith("Result")],
        "Refusals": [n for n in names if not n.islower() and not n.endswith("Result")],
    }
    parts = [
        "# Python",
        "All that `import rulec` offers; how it is used tells"
        " [Use from Python](../use-from-python.md).",
    ]
    for title, group in groups.items():
        parts.append(f"## {title}")
        parts += [_directive(name) for name in group]
    return "\n\n".join(parts) + "\n"


def _directive(name: str) -> str:
    found = getattr(rulec, name)
    return (
        f"::: {found.__module__}.{name}\n    options: {{heading_level: 3, heading: rulec.{name}}}"
    )
