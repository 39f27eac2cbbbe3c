"""Set points that tell explanations apart: what they are worth, and what is foretold of them."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rulec.cli import main
from rulec.mismatch.experiment.choose import certain, chosen, factors_of
from rulec.mismatch.experiment.foretell import Foretold
from rulec.prove.truth.settled.plan import Planned

HALVES = np.array([0.5, 0.5])


def told(off: float, spread: float) -> list[Foretold]:
    """Two explanations, each foretelling one reading at each of two places: at the first alike, at
    the second so far apart, the second explanation with so large a spread."""
    place = np.array([0, 1])
    covariance = (np.eye(2), np.diag([1.0, spread]))
    first = Foretold({}, place, (np.zeros(2), np.array([0.0, off])), covariance)
    second = Foretold({}, place, (np.array([0.0, -off]), np.zeros(2)), covariance)
    return [first, second]


@pytest.mark.parametrize(("off", "spread"), [(3.0, 1.0), (0.0, 4.0), (2.0, 2.0)])
def test_a_factor_is_the_divergence_of_two_normal_distributions(off: float, spread: float) -> None:
    """Source: Kullback and Leibler 1951, for one dimension."""
    factors = factors_of(told(off, spread), [1])
    forward = 0.5 * (math.log(spread) + (1.0 + off**2) / spread - 1.0)
    backward = 0.5 * (-math.log(spread) + (spread + off**2) - 1.0)
    assert factors[0, 1] == pytest.approx(forward)
    assert factors[1, 0] == pytest.approx(backward)


def test_certainty_runs_from_chance_to_one() -> None:
    """Without a factor it is that of the odds; with large ones the truth stands alone."""
    assert certain(HALVES, np.zeros((2, 2))) == pytest.approx(0.5)
    assert certain(HALVES, np.full((2, 2), 50.0) * (1 - np.eye(2))) == pytest.approx(1.0)


def test_the_place_is_chosen_where_they_differ() -> None:
    """Where they are alike a step is worth nothing, and none is taken."""
    choice = chosen(told(4.0, 1.0), HALVES, 1)
    assert choice.places == (1,)
    assert choice.certainty[1] > 0.99
    assert chosen(told(0.0, 1.0), HALVES, 3).places == ()


@pytest.fixture(scope="module")
def ambiguous(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive that takes back its speed at high power, which three laws of the catalogue do."""
    folder = tmp_path_factory.mktemp("ambiguous")
    case = Planned("a case", "single", "dosing", "steps", ("folded-back",), aim=300.0, small=True)
    case.make().write(folder)
    plant, recording = str(folder / "plant"), str(folder / "recording.csv")
    assert main(["mismatch", plant, recording, "--json", str(folder / "m.json")]) == 0
    return folder


def test_a_recipe_can_be_run(ambiguous: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Set points lie within what was recorded; `rulec simulate` takes the inputs; certainty grows
    from step to step; and each explanation finds what it foretells itself."""
    inputs, form = ambiguous / "in.csv", ambiguous / "e.json"
    file = str(ambiguous / "m.json")
    assert main(["experiment", file, "-o", str(inputs), "--json", str(form)]) == 0
    assert "can be expected to be" in capsys.readouterr().out
    found: dict[str, Any] = json.loads(form.read_text(encoding="utf-8"))
    assert len(found["explanations"]) >= 2
    assert found["steps"]
    assert found["certainty"] == sorted(found["certainty"])
    assert found["certainty"][-1] > found["certainty"][0] + 0.1
    recorded = columns(ambiguous / "recording.csv")
    for step in found["steps"]:
        for name, value in step["inputs"].items():
            readings = recorded[name]
            assert readings.min() * 0.999 <= value["value"] <= readings.max() * 1.001
    simulated = ambiguous / "out.csv"
    assert main(["simulate", str(ambiguous / "plant"), str(inputs), "-o", str(simulated)]) == 0
    assert len(simulated.read_text(encoding="utf-8").splitlines()) == 1 + 10 * len(found["steps"])


def columns(file: Path) -> dict[str, np.ndarray]:
    """Readings by signal."""
    with file.open(encoding="utf-8", newline="") as lines:
        head, *rows = csv.reader(lines)
    table = np.array([[float(cell or "nan") for cell in row] for row in rows])
    return {title.partition(" [")[0]: table[:, i] for i, title in enumerate(head)}


def test_fewer_hours_allow_fewer_steps(ambiguous: Path, tmp_path: Path) -> None:
    form = tmp_path / "e.json"
    main(["experiment", str(ambiguous / "m.json"), "--hours", "0", "--json", str(form)])
    assert json.loads(form.read_text(encoding="utf-8"))["steps"] == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda form: form.pop("standing"), "does not say which explanations stand"),
        (lambda form: form.update(standing=[]), "no sets of explanations were weighed"),
        (lambda form: form.update(standing=form["standing"][:1]), "stands alone"),
        (lambda form: form["standing"][0].update(probability="much"), "does not say which"),
        (lambda form: form["standing"][0].update(joined=["A.no-such@n"]), "A.no-such@n"),
    ],
)
def test_what_cannot_be_planned_is_refused(
    ambiguous: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: Any, words: str
) -> None:
    form = json.loads((ambiguous / "m.json").read_text(encoding="utf-8"))
    change(form)
    file = tmp_path / "m.json"
    file.write_text(json.dumps(form), encoding="utf-8")
    assert main(["experiment", str(file)]) == 1
    assert words in " ".join(capsys.readouterr().err.split())
