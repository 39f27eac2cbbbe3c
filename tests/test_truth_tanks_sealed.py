"""Sealed cases of tanks: nothing told beforehand, the limit of what can be seen."""

import functools
import hashlib
import pickle
from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main as rulec
from rulec.effects.model_builder import open_builder
from rulec.prove.truth.detection_limit import expected_gain
from rulec.prove.truth.kinds import STATED
from rulec.prove.truth.tanks.build import CASCADED
from rulec.prove.truth.tanks.effect import EFFECTS, possible_effects
from rulec.prove.truth.tanks.plan import Case
from rulec.prove.truth.tanks.right_answer import right
from rulec.prove.truth.tanks.rows import row, write_plant
from rulec.prove.truth.tanks.suite import HARD, RARELY, STRONGEST, WEAKEST, cases
from tests.conftest import ROOT, plain_yaml
from tests.tank_row import case

SHORT = 90
RANDOM = np.random.default_rng(5)


@functools.cache
def made(*effects: str, strength: float | None = None) -> Case:
    return case(3, *effects, samples=SHORT, strength=strength)


def test_gain_of_nothing_is_nothing_and_grows_with_the_size() -> None:
    """As the square of the size, since all is linear."""
    slopes, flat = RANDOM.normal(size=(40, 4)), np.zeros((40, 0))
    d = RANDOM.normal(size=40)
    assert expected_gain(np.zeros(40), slopes, flat) == 0.0
    assert expected_gain(2.0 * d, slopes, flat) == pytest.approx(4 * expected_gain(d, slopes, flat))


def test_gain_is_that_of_the_full_covariance() -> None:
    """With and without other effects, whose flat prior is a very wide one."""
    d, slopes, flat = (RANDOM.normal(size=s) for s in (30, (30, 5), (30, 2)))
    slopes[:, 0] *= 1e3  # a parameter of which nothing is known
    for others in (flat, flat[:, :0]):
        covariance = np.eye(30) + slopes @ slopes.T + 1e8 * others @ others.T
        expected = 0.5 * d @ np.linalg.solve(covariance, d)
        assert expected == pytest.approx(expected_gain(d, slopes, others), rel=1e-5)


def test_what_may_be_anything_takes_from_the_gain() -> None:
    """A flat direction lowers it; the effect's own leaves nothing; dependent ones do no harm."""
    d, slopes, flat = (RANDOM.normal(size=s) for s in (30, (30, 3), (30, 1)))
    none = np.zeros((30, 0))
    assert expected_gain(d, slopes, flat) < expected_gain(d, slopes, none)
    assert expected_gain(d, slopes, d[:, None]) == pytest.approx(0.0, abs=1e-12)
    doubled = np.column_stack([flat, 3.0 * flat, 0.0 * flat])
    assert expected_gain(d, slopes, doubled) == pytest.approx(expected_gain(d, slopes, flat))


def test_answer_is_sealed() -> None:
    """By the digest of the text that is shown later."""
    one, other = (made("upper.power-high", strength=s).answer for s in (0.3, 0.03))
    assert one.digest != other.digest
    assert hashlib.sha256(one.to_json().encode()).hexdigest() == one.digest


def test_what_is_written_tells_nothing(tmp_path: Path) -> None:
    """The folder of a planted case is that of a clean one, but for the readings."""
    written = {}
    for name, one in (("planted", made("upper.overflow-sharp")), ("clean", made())):
        one.write(tmp_path / name)
        files = [f for f in (tmp_path / name).rglob("*") if f.is_file()]
        written[name] = {str(f.relative_to(tmp_path / name)): f.read_bytes() for f in files}
    planted, clean = written["planted"], written["clean"]
    assert {"recording.csv", "plant/plant.yaml", "plant/columns.yaml"} == set(planted)
    assert planted.pop("recording.csv") != clean.pop("recording.csv")
    assert planted == clean
    assert not any(b"overflow" in content for content in planted.values())


@pytest.mark.parametrize("metered", [False, True])
def test_rows_are_plants_that_the_tool_accepts(metered: bool, tmp_path: Path) -> None:
    layout = next(one for one in map(row, range(30)) if one.metered == metered)
    assert rulec(["check", str(write_plant(layout, tmp_path / "plant"))]) == 0


def test_rows_are_of_all_kinds() -> None:
    """Two to four tanks, of which the last is measured, and some others; some metered."""
    layouts = [row(seed) for seed in range(30)]
    assert all(one.tanks[-1] in one.measured for one in layouts)
    assert {2, 3, 4} == {len(one.tanks) for one in layouts}
    assert {True, False} == {one.metered for one in layouts}
    assert {1, 2} <= {len(one.measured) for one in layouts}


QUALITY = ("stuck-reading", "coarse-steps")
"""What is told of a reading by itself, without an entry."""


def test_the_catalogue_knows_every_name() -> None:
    for effect in EFFECTS:
        for stated in effect.stated.get("right", ()):
            if stated.get("name") in (None, *QUALITY):
                continue
            (file,) = ROOT.glob(f"kb/*ts/{stated['name']}.yaml")
            parameters = set(plain_yaml(file).get("parameters", {"x": None}))
            assert set(stated.get("parameters", ())) <= parameters, stated["name"]


@pytest.mark.prove
def test_places_of_the_key_are_places_of_the_tool() -> None:
    """Of the shipped plant; `y` of a level that is not measured is never one."""
    _, builder = open_builder(ROOT / "plants" / CASCADED.name)
    known = {f"{c.module}.{c.place}" for c in builder.candidates} | {"lower.h", "upper.h"}
    for effect in possible_effects(CASCADED):
        (one,) = made(effect).planted
        assert set(right(made(effect).setup, one).places) <= known, effect


def test_parameters_are_those_of_the_entry() -> None:
    """In its unit: what is caught as share, the width as half of it, a share in percent."""
    tank = made("upper.overflow-sharp").plant.tank("upper")
    assert tank.rim is not None
    (overflow,) = made("upper.overflow-sharp").answer.effects
    assert overflow.names == ("overflow-caught",)
    expected = {"l_o": tank.rim.height, "f": tank.rim.caught}
    assert overflow.parameters["overflow-caught"] == pytest.approx(expected)
    clogged = made("lower.clogging")
    clog = clogged.plant.tank("lower").clog
    assert clog is not None
    (clogging,) = clogged.answer.effects
    assert clogging.parameters["blockage"]["x"] == pytest.approx(100.0 * clog.size)
    assert clogged.answer.verdict == "fault"


def test_what_no_entry_names_is_unnamed_and_has_a_place() -> None:
    """Also where it is an error of a sensor."""
    answer = made("lower.y.jet").answer
    (jet,) = answer.effects
    assert (jet.names, jet.sort, jet.places) == ((), "unnamed", ("lower.y",))
    assert answer.verdict == "unnamed"


def test_gain_grows_with_strength() -> None:
    """From hardly anything to plain."""
    weak, strong = (made("upper.power-high", strength=s).answer.effects[0] for s in (0.03, 0.3))
    assert weak.gain < 0.1 * strong.gain


def test_suite_is_a_list_that_depends_on_its_seed() -> None:
    """Each case of each group alone; all can be sent to another process."""
    groups = [group for group in STATED["tanks"] if group not in HARD]
    count = dict.fromkeys(groups, 6)
    planned = list(cases(1, count))
    assert planned == list(cases(1, count)) == pickle.loads(pickle.dumps(planned))
    assert planned != list(cases(2, count))
    assert len(planned) == 6 * len(groups) == len({p.name for p in planned})
    for one in planned:
        assert set(one.effects) <= set(possible_effects(one.layout))
        assert (one.group == "clean") == (one.effects == ())
        assert one.strength is None or WEAKEST <= one.strength <= STRONGEST
        assert one.group != "corner" or one.rarely == RARELY
    assert list(cases(1, {"clean": 6})) == [p for p in planned if p.group == "clean"]


def test_planned_cases_can_be_made() -> None:
    """Of a row that is drawn, as short as a test needs."""
    planned = next(p for p in cases(1, {"sensor": 9}, SHORT) if p.layout != CASCADED)
    answer = planned.make().answer
    assert (planned.name, "dynamic", SHORT) == (answer.case, answer.half, answer.samples)
