"""The report: what is missing, how much of the error it explains, pictures, numbers, origin."""

from __future__ import annotations

from rulec_runtime.report.document import document, facts, numbered, section
from rulec_runtime.report.text import counted, number

from rulec.mismatch.answer.pictures import pictures_of
from rulec.mismatch.answer.summary import told_first
from rulec.mismatch.answer.tables import (
    doubts,
    other_readings,
    parameters,
    proof_table,
    rivals,
    rows_used,
)
from rulec.mismatch.answer.wording import of_recordings_words
from rulec.mismatch.result import Mismatch


def report(mismatch: Mismatch) -> str:
    """Write a report; the same comparison gives the same text."""
    sections = [told_first(mismatch)]
    if mismatch.recordings:
        told = facts([(term, [text]) for term, text in of_recordings_words(mismatch)])
        sections.append(section("Recordings", f'<div class="facts">{told}</div>'))
    if mismatch.fit is not None:
        proof = proof_table(mismatch, mismatch.fit) + other_readings(mismatch) + rivals(mismatch)
        sections.append(section("Proof", proof))
    pictures = "".join(numbered(pictures_of(mismatch)))
    sections += [
        section(title, body)
        for title, body in (
            ("Pictures", pictures),
            ("Numbers", parameters(mismatch) + doubts(mismatch)),
            ("Rows of the recording", rows_used(mismatch)),
            ("Where this comes from", f'<div class="facts">{_origin(mismatch)}</div>'),
        )
        if body
    ]
    return document(mismatch.title, mismatch.recording, "mismatch", "".join(sections))


def _origin(mismatch: Mismatch) -> str:
    """Plant, recording, split, noise, how many explanations were tried, remarks."""
    tried = f"{counted(mismatch.tried, 'candidate')} in {number(mismatch.seconds, 2)} s"
    return facts(
        [
            ("Plant", [f"{mismatch.plant}: {mismatch.title}"]),
            ("Recording", [mismatch.recording]),
            ("Blocks", [mismatch.split] if mismatch.split else []),
            ("Hash of the blocks", [mismatch.digest] if mismatch.digest else []),
            ("Noise", [mismatch.noise] if mismatch.noise else []),
            ("Tried", [tried] if mismatch.tried else []),
            (
                "Sources",
                list(dict.fromkeys(f"{f.name}: {f.source}" for f in mismatch.findings if f.source)),
            ),
            ("Remarks", list(dict.fromkeys(mismatch.notes))),
        ]
    )
