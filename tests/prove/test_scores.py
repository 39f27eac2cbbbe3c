"""Scores, mistakes, page and terminal of runs made by hand."""

import json
import re
from dataclasses import replace

import pytest
from rulec_runtime.output.terminal import Terminal
from scipy.stats import binomtest

from rulec.prove.page import headline, page, show, worst
from rulec.prove.results import Claim, Judged, Run
from rulec.prove.scores import reliability, table, trust, wilson
from tests.prove.made import judged, planted, run
from tests.runtime.reports import tree

HOSTILE = "<b>x</b><script src='//x'>"


def text(made: Run, width: int = 100) -> str:
    """What the terminal shows, without colours."""
    out = Terminal(width=width, color_system=None)
    with out.capture() as shown:
        show(out, made)
    return shown.get()


@pytest.mark.parametrize(("hits", "count"), [(0, 5), (5, 5), (187, 200), (1, 1), (95, 100)])
def test_intervals_are_those_of_wilson(hits: int, count: int) -> None:
    expected = binomtest(hits, count).proportion_ci(method="wilson")
    assert pytest.approx((expected.low, expected.high), abs=1e-9) == wilson(hits, count)


def test_a_share_without_case_is_not_met() -> None:
    """It says so, in the table, on the page and on the terminal."""
    made = Run((judged(clean_right=1.0),))
    rows = table(made.judged)[:3]
    assert ["no case", "no case", "met"] == [r.words.split(",")[0] for r in rows]
    assert [None, None, True] == [r.met for r in rows]
    assert "no case" in page(made)
    assert "no case" in text(made)


RIGHT, WRONG = judged(clean_right=1.0), judged(clean_right=0.0)
TWO = planted("a", "leakage", 9.0, claims=(Claim(0.95, True), Claim(0.92, False)))
UNSURE = planted("b", "leakage", 9.0, claims=(Claim(0.8, False),), name_right=0.5)
FALSE = judged(clean_right=0.0, claims=(Claim(0.99, False),))


@pytest.mark.parametrize(
    ("score", "cases", "hits", "words"),
    [
        # 200 of 200 is more than 98.1 %, which is not surely 99 %; 150 of 200 is surely less.
        ("clean", [RIGHT] * 200, (200, 200), "met, not surely"),
        ("clean", [RIGHT] * 150 + [WRONG] * 50, (150, 200), "missed"),
        ("clean", [RIGHT] * 800, (800, 800), "met"),
        # An ambiguity is half a hit; truth in intervals is counted by interval.
        ("name", [TWO, UNSURE], (1.5, 2), "missed, not surely"),
        ("truth", [judged(inside=(3, 4)), judged(inside=(2, 2)), RIGHT], (5, 6), None),
        # All of 1000 inside is not what 95 % promises.
        ("truth", [judged(inside=(1000, 1000))], (1000, 1000), "missed"),
        ("truth", [judged(inside=(950, 1000))], (950, 1000), "met"),
        ("truth", [judged(inside=(965, 1000))], (965, 1000), "met, not surely"),
        # False names of clean cases too; what is told as one of several is none.
        ("false names", [TWO, UNSURE, FALSE], (2, 3), "missed"),
        ("false names", [TWO] * 100, (100, 200), "missed"),
        ("false names", [planted("c", "leakage", 9.0)], (0, 1), "met, not surely"),
    ],
)
def test_scores_are_counted_and_judged_with_their_doubt(
    score: str, cases: list[Judged], hits: tuple[float, int], words: str | None
) -> None:
    found = next(row for row in table(cases) if row.score.startswith(score))
    assert hits == (found.hits, found.count)
    assert words in (None, found.words)


def test_the_worst_come_first() -> None:
    """Wrong and certain by strength, false claims, no answer, then what was missed."""
    gone = {"said": (), "verdict": "none", "name_right": 0.0}
    cases = [
        planted("missed weak", "leakage", 9.0, **gone),
        planted("missed strong", "leakage", 99.0, **gone),
        planted("crashed", "leakage", 1.0, **{**gone, "error": "crashed"}),
        judged("claimed", clean_right=0.0, verdict="named", said=("x@A.y",)),
        judged("clean", clean_right=1.0),
        planted("right", "leakage", 500.0),
        planted("wrong", "leakage", 9.0, "x"),
        planted("very wrong", "leakage", 90.0, "x"),
        planted("unsure", "leakage", 90.0, "x", verdict="ambiguous"),
    ]
    order = "very wrong, wrong, claimed, crashed, missed strong, unsure, missed weak"
    assert order == ", ".join(bad.case for bad, _ in worst(cases))
    assert 3 == len(worst(cases, 3))


def test_a_run_is_json() -> None:
    """Infinite numbers too, as text."""
    made = Run((judged(gain=float("inf")),))
    (found,) = json.loads(json.dumps(made.form(), allow_nan=False))["judged"]
    assert ("case", "inf") == (found["case"], found["gain"])


def test_final_cases_are_told() -> None:
    """Scores of development cases are no proof, and the page says so."""
    made, early = run(40), run(10, partition="development")
    assert "on 40 final cases" in headline(made, table(made.judged))
    assert "on 10 development cases" in headline(early, table(early.judged))
    assert "they prove nothing yet" in page(early)
    assert "opened 1 time" in page(made)


MADE = {
    "nothing": Run(()),
    "no score": Run((judged(),)),
    "one claim": Run((judged(clean_right=0.0),)),
    "endless": Run((planted("a", "leakage", float("inf")),)),
    "one": Run((planted("a", "leakage", 0.0),)),
    "many": run(60),
}


@pytest.mark.parametrize("made", MADE.values(), ids=MADE)
def test_every_run_gives_a_sound_page(made: Run) -> None:
    """Well-formed, without NaN, nothing from outside; the same bytes again."""
    written = page(made)
    tree(written)
    assert [] == re.findall(r"[ \"(>]-?(?:nan|inf)\b", written)
    assert [] == re.findall(r"https?:|//\w|<script|<img|<link|@import|url\(|\ssrc=", written)
    assert written == page(made)
    assert "\x1b" not in text(made)


def test_hostile_names_are_escaped() -> None:
    """Wherever a text of a case may stand."""
    names = {"places": (HOSTILE,)}
    bad = planted(HOSTILE, HOSTILE, 9.0, f"{HOSTILE}!", **names)
    lost = replace(bad, error=HOSTILE)
    texts = {"digest": HOSTILE, "version": HOSTILE, "notes": (HOSTILE,)}
    written = page(Run((bad, lost), openings=1, **texts))
    tree(written)
    assert "<b>x" not in written
    assert "<script" not in written
    name = "[red]x[/nothing]"
    assert "[red]" not in text(Run((replace(bad, case=name),))).replace(name, "")


def test_the_terminal_shows_table_and_worst() -> None:
    """Goals in words, the worst cases with what was said."""
    shown = text(run(200), 120)
    assert "name right" in shown
    assert re.search(r"clean called clean +99 % +100 .*(met|missed)", shown)
    assert "The worst cases" in shown
    assert "wrong and certain" in shown


def test_probabilities_are_held_against_what_is_right() -> None:
    """Of names told at 0.95 half are right: too sure; all told at 0.6 are right: shy."""
    sure = [planted(f"s{i}", "leakage", 9.0, claims=(Claim(0.95, i % 2 == 0),)) for i in range(40)]
    shy = [planted(f"t{i}", "leakage", 9.0, claims=(Claim(0.6, True),)) for i in range(40)]
    known = [planted("u", "leakage", 9.0, claims=(Claim(1.0, True), Claim(0.2, False)))]
    found = reliability([*sure, *shy, *known])
    assert [(1, 0), (40, 40), (40, 20), (1, 1)] == [(row.count, row.hits) for row in found]
    assert ["as said", "shy", "too sure", "as said"] == [trust(row) for row in found]
    assert [0.2, 0.6, 0.95, 1.0] == pytest.approx([row.goal.low for row in found])
    shown = Run((*sure, *shy))
    assert "too sure" in text(shown)
    assert "too sure" in page(shown)
