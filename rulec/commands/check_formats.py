"""Mistakes and doubts for programs: as JSON, and as SARIF for editors and CI servers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any
from urllib.parse import quote

from rulec.language.diagnostics import Diagnostic, Place

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def json_form(found: Sequence[Diagnostic]) -> list[dict[str, Any]]:
    """Each diagnostic with its place; lines and columns count from 1."""
    return [
        {
            "code": one.code,
            "kind": "doubt" if one.doubt else "mistake",
            "message": one.message,
            "hint": one.hint,
            **asdict(one.place),
            "see_also": None if one.second is None else asdict(one.second),
        }
        for one in found
    ]


def sarif_form(found: Sequence[Diagnostic], version: str) -> dict[str, Any]:
    """A log with one run. Mistakes are errors, doubts are warnings."""
    driver = {
        "name": "rulec",
        "version": version or "0",
        "rules": [{"id": code} for code in sorted({one.code for one in found})],
    }
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "results": [_result(one) for one in found],
    }
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


def _result(one: Diagnostic) -> dict[str, Any]:
    text = f"{one.message} ({one.hint})" if one.hint else one.message
    result = {
        "ruleId": one.code,
        "level": "warning" if one.doubt else "error",
        "message": {"text": text},
        "locations": [_location(one.place)],
    }
    if one.second is not None:
        result["relatedLocations"] = [_location(one.second)]
    return result


def _location(place: Place) -> dict[str, Any]:
    region = {
        "startLine": place.line,
        "startColumn": place.column,
        "endColumn": place.column + place.length,
    }
    return {"physicalLocation": {"artifactLocation": {"uri": quote(place.file)}, "region": region}}
