"""What the site has beside the pages of docs/: the README, the changelog, and the reference.

The reference is made when the site is built: from the parsers of the commands, the schemas of YAML,
the module types that come with rulec, what commands write as JSON, and the docstrings of `import
rulec`. Nothing of it is kept.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from command_reference import command_page
from json_reference import json_page
from library_reference import library_page
from mkdocs.structure.files import File, Files
from python_reference import python_page
from yaml_reference import yaml_page

ROOT = Path(__file__).parents[2]


def _front_page() -> str:
    """README.md, whose links begin at the top of the project."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.sub(r"(?<=\]\()docs/", "", text).replace("[docs/", "[")


def _changes() -> str:
    return (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").replace("](docs/", "](")


MADE: dict[str, Callable[[], str]] = {
    "index.md": _front_page,
    "changelog.md": _changes,
    "reference/commands.md": command_page,
    "reference/yaml.md": yaml_page,
    "reference/library.md": library_page,
    "reference/json.md": json_page,
    "reference/python.md": python_page,
    "site.css": lambda: ".md-typeset td:first-child code { white-space: nowrap; }\n",
}


def on_files(files: Files, config: Any) -> Files:
    """Add what is made."""
    for name, make in MADE.items():
        files.append(File.generated(config, name, content=make()))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Lead links to files beside docs/ to their page."""
    return markdown.replace("](../CHANGELOG.md)", "](changelog.md)")
