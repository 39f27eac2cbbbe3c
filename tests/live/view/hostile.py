"""A moment whose every field holds a hostile text."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

from rulec_runtime.live.moment import Now

from tests.hostile.texts import MARKUP, STEERING
from tests.live.view.nows import failing

PAGE = [
    "<script>window.pwned=1</script>",
    '"><img src=x onerror=window.pwned=1>',
    "'><svg onload=window.pwned=1>",
    "</style><b id=pwned>x</b>",
    "]]>--><b id=pwned>x</b>",
    "\ndata: <b id=pwned>x</b>\n\nevent: now",
]
"""Markup and breaks that a page or a stream of events may fall for."""

TEXTS = [*STEERING.values(), *MARKUP, *PAGE, "\u200f\u202ex", "e\u0301" * 40, "漢" * 30, "x" * 5000]

KEPT = {"id", "kind", "status", "what", "subject", "unit"}
"""What links the parts of a moment, or is one of few words."""


def hostile(text: str) -> Now:
    """The same text before every text of a moment: of episodes, events, plant and source."""
    now = failing()
    parts = {
        f.name: _with(getattr(now, f.name), text) for f in fields(now) if f.name != "diagnosis"
    }
    assert now.diagnosis is not None
    diagnosis = now.diagnosis
    ruleset = replace(
        diagnosis.ruleset,
        title=text + diagnosis.ruleset.title,
        modules={text + name: text + title for name, title in diagnosis.ruleset.modules.items()},
        unobserved=(text,),
    )
    findings = tuple(
        replace(f, text=text + f.text, fault=replace(f.fault, action=text, meaning=text))
        for f in diagnosis.findings
    )
    periods = tuple(replace(p, text=text + p.text) for p in diagnosis.not_judged)
    parts["status"] = now.status
    parts["remark"] = text
    parts["diagnosis"] = replace(
        diagnosis, ruleset=ruleset, findings=findings, not_judged=periods, notes=(text,)
    )
    first, *others = parts["active"]
    strange = replace(first, id=text, subject=text, unit=text, alternatives=((text, 0.4),))
    parts["active"] = (strange, replace(strange, id=f"{text}2", kind="fault"), *others)
    return Now(**parts)


def _with(value: Any, text: str) -> Any:
    if isinstance(value, str):
        return text + value
    if isinstance(value, tuple):
        return tuple(_with(part, text) for part in value)
    if is_dataclass(value) and not isinstance(value, type) and type(value).__name__ != "Calendar":
        kept = {f.name: getattr(value, f.name) for f in fields(value)}
        return replace(value, **{k: v if k in KEPT else _with(v, text) for k, v in kept.items()})
    return value
