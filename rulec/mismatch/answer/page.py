"""The report: what is missing, how much of the error it explains, pictures, numbers, origin."""

from __future__ import annotations

from rulec_runtime.report.document import Head, document, facts, numbered, section
from rulec_runtime.report.html_story import badge
from rulec_runtime.report.made import Made
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import counted, number

from rulec.mismatch.answer.pictures import pictures_of
from rulec.mismatch.answer.summary import marks, told_first, verdict
from rulec.mismatch.answer.tables import (
    doubts,
    other_readings,
    parameters,
    proof_table,
    rivals,
    rows_used,
)
from rulec.mismatch.answer.wording import letter, of_recordings_words, proof_title
from rulec.mismatch.result import Mismatch


def report(mismatch: Mismatch, subject: Subject, made: Made | None = None) -> str:
    """Write a report; the same comparison gives the same text.

    Parameters
    ----------
    subject : the plant as its file says, and the recording.
    made : when and by what; left out without.
    """
    sections = [told_first(mismatch)]
    leading, others = pictures_of(mismatch, subject.calendar)
    if leading:
        sections.append(section("What it depends on", "".join(numbered(leading))))
    if mismatch.recordings:
        told = facts([(term, [text]) for term, text in of_recordings_words(mismatch)])
        sections.append(section("Recordings", f'<div class="facts">{told}</div>'))
    if mismatch.fit is not None:
        proof = proof_table(mismatch, mismatch.fit) + other_readings(mismatch) + rivals(mismatch)
        sections.append(section(proof_title(mismatch), proof))
    pictures = "".join(numbered(others, 1 + len(leading)))
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
    said, more = verdict(mismatch)
    head = Head(
        kind="Mismatch of simulation and recording",
        verdict=said,
        meaning=more,
        badge=badge(letter(mismatch)),
        facts=tuple(subject.facts()),
        made=made,
        sketch=sketch(subject.ruleset, marks(mismatch)),
    )
    return document(head, "".join(sections))


def _origin(mismatch: Mismatch) -> str:
    """Split, noise, how many explanations were tried, remarks."""
    tried = f"{counted(mismatch.tried, 'candidate')} in {number(mismatch.seconds, 2)} s"
    return facts(
        [
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
