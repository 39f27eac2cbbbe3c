"""Real recordings in a plain form: what is wrong with a folder, what is shown, how it is scored."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.terminal import Terminal
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from rulec.mismatch.answer.json_form import mismatch_form
from rulec.passes.pipeline import compile_plant
from rulec.prove.real import rig_folder
from rulec.prove.real import run_tool as asking
from rulec.prove.real.renamed_rig import differences, hide
from rulec.prove.real.rig_folder import ANSWER, SEAL, FalseAlarm, Missing, Rig, Size, read_rig
from rulec.prove.real.run_tool import MODELS, Commands, lay_out, predicted
from rulec.prove.real.score import Scored, alarms, scored, scored_finding, totals, utility
from rulec.prove.real.score_table import Result, form, page, tell
from tests.conftest import ROOT, Patch
from tests.runtime.mismatches import NAMED

SHIPPED = ROOT / "tests" / "rig" / "shipped"
ROWS = 40


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one small rig: the first rows of what is shipped."""
    folder = tmp_path_factory.mktemp("small") / "rigs" / "small"
    shutil.copytree(SHIPPED / "rse-boiler", folder)
    for part in ("train", "test"):
        with rig_folder.open_text(folder / f"{part}.csv.gz") as file:
            rows = [line for line, _ in zip(file, range(ROWS), strict=False)]
        (folder / f"{part}.csv.gz").unlink()
        (folder / f"{part}.csv").write_text("".join(rows), encoding="utf-8")
    return folder.parent


@pytest.fixture
def folder(small: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(small, tmp_path / "rigs"))


@pytest.fixture(scope="module")
def rig(small: Path) -> Rig:
    (found,) = rig_folder.rigs_in(small)
    return found


def seal(rig: Path, answer: dict[str, Any]) -> None:
    (rig / ANSWER).write_text(json.dumps(answer), encoding="utf-8")
    (rig / SEAL).write_text(rig_folder.digest_of(rig / ANSWER), encoding="utf-8")


def asked(effects: list[dict[str, Any]] | None = None) -> dict[str, Any]:
    """What `ask` would give."""
    found = mismatch_form(NAMED, "plant.yaml")
    found["effects"] = found["effects"] if effects is None else effects
    rms = {"shipped": 4.0, "recalibrated": 2.0, "adopted": 1.0}
    rows = list(map(float, range(9)))
    errors: dict[str, Any] = {"unit": "m3/h", "rows": 9, **rms}
    errors["course"] = {n: [i + e for i in rows] for n, e in rms.items()}
    errors["course"] |= {"time": rows, "measured": rows}
    answer = {"form": found, "error": "", "refused": ""}
    return answer | {"predicted": {"boiler.Q": errors}}


def finding(name: str, location: str, probability: float, **others: Any) -> dict[str, Any]:
    """A finding in the machine form of the tool."""
    module, _, relation = location.partition(".")
    plain = {"effect": name, "id": f"{module}.{name}@{relation}", "sort": "physics"}
    plain |= {"module": module, "modules": [module], "place": relation, "parameters": {}}
    plain |= {"probability": probability, "class_probability": probability, "alternatives": []}
    return plain | {"periods": []} | others


HEAD = "rig: small\ntitle: x\nlicence: y\nsource: z\n"
WRONG = [
    ("rig.yaml", None, "a rig needs 'rig.yaml'"),
    ("plain/plant.yaml", None, "the plant without the effect"),
    ("train.csv", None, "rows that are shown to the tool"),
    ("test.csv", None, "rows that are kept from it"),
    (SEAL, None, "sha256sum answer.yaml"),
    (SEAL, "0123  answer.yaml", "is not the one that was sealed"),
    ("rig.yaml", "rig: small\ntitle: x\nlicense: y\nsource: z\n", "did you mean 'licence'"),
    ("test.csv", "time [s],P101 [Hz]\n0,30\n1,30\n", "lacks columns that train has: boiler."),
    ("rig.yaml", f"{HEAD}signal: boiler.q\n", "did you mean 'boiler.Q'"),
    (
        "rig.yaml",
        f"{HEAD}grey_box: [{{signal: boiler.Q, error: 3, unit: l/h, source: x}}]\n",
        "'boiler.Q' is in m3/h",
    ),
    ("plain/plant.yaml", "plant: x\n", "needs the keys"),
]


def refused_of(folder: Path) -> str:
    with pytest.raises(Refusal) as refused:
        rig_folder.rigs_in(folder)
    return refused.value.for_terminal()


@pytest.mark.parametrize(("name", "text", "why"), WRONG)
def test_a_wrong_folder_is_told(folder: Path, name: str, text: str | None, why: str) -> None:
    """With its place; nothing is asked."""
    file = folder / "small" / name
    file.unlink()
    if text is not None:
        file.write_text(text, encoding="utf-8")
    said = refused_of(folder)
    assert why in said
    assert "small" in said


def test_two_calibrations_are_refused(folder: Path) -> None:
    plant = folder / "small" / "plain" / "plant.yaml"
    text = plant.read_text(encoding="utf-8")
    plant.write_text(f"{text}calibration: [found.yaml]\n", encoding="utf-8")
    shutil.copyfile(folder / "small" / "train.csv", folder / "small" / "earlier.csv")
    with pytest.raises(Refusal, match="the plant is calibrated already"):
        read_rig(folder / "small")


SIZE = {"parameter": "d", "value": 1, "u": 0.1, "unit": "m3/hour"}


@pytest.mark.parametrize(
    ("effect", "why"),
    [
        (None, "either 'nothing: true' or 'effects'"),
        ({"names": "equal-percentge", "places": "boiler"}, "'equal-percentage'"),
        ({"names": [], "places": "kettle.x"}, "there is no module of the plant"),
        ({"names": "offset"}, "'places'"),
        ({"names": "offset", "places": "boiler.Q", "sizes": [SIZE]}, "there is no unit 'm3/hour'"),
    ],
)
def test_a_wrong_answer_is_told(folder: Path, effect: dict[str, Any] | None, why: str) -> None:
    seal(folder / "small", {"source": "by hand"} | ({"effects": [effect]} if effect else {}))
    assert why in refused_of(folder)


def test_all_mistakes_come_at_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As the command says them; a folder that is not there, a name that no rig has, and options
    that exclude each other as well."""
    shutil.copytree(folder / "small", folder / "other")
    for name in ("small", "other"):
        (folder / name / "rig.yaml").unlink()
    for code, words, why in (
        (1, ["--real", str(folder)], ("small", "other")),
        (1, ["--real", str(folder), "--only=third"], ("no rig has this in its name",)),
        (1, ["--real", str(folder / "nowhere")], ("there is no such folder",)),
        (2, ["--hidden-names"], ("add --real DIR",)),
        (2, ["--real", str(folder), "--rounds=2"], ("leave --real out",)),
        (2, ["--real", str(folder), "--hard"], ("leave --hard out",)),
        (2, ["--blind", str(ROOT / "plants" / "abc"), "x.csv", "--hard"], ("leave --hard out",)),
        (2, ["--quick", "--baselines"], ("add --rounds 2",)),
        (2, ["--quick", "--baselines", "same"], ("add --rounds 2",)),
        (2, ["--quick", "--rounds", "2"], ("add --only stationary",)),
        (2, ["--quick", "--rounds", "2", "--hard"], ("leave --hard out",)),
        (2, ["--real", str(folder), f"--json={folder / 'no' / 'x'}"], ()),
    ):
        assert code == main(["prove", *words])
        said = capsys.readouterr().err
        assert all(part in said for part in why), said


def test_without_an_answer_prediction_is_judged(folder: Path) -> None:
    """A seal alone stands for an answer that is kept elsewhere."""
    (folder / "small" / ANSWER).unlink()
    found = read_rig(folder / "small")
    assert found.truth is None
    assert 64 == len(found.seal)
    result = scored(found, asked([finding("leak", "boiler.Q", 1.0)]))
    assert result.place is result.utility is result.silent is None
    assert () == result.false
    assert 0.5 == result.ratio("recalibrated")


def test_what_judges_is_not_shown(rig: Rig, tmp_path: Path, monkeypatch: Patch) -> None:
    """When the tool looks, its folder holds neither answer nor unseen rows, nor a way to them."""
    work, seen = tmp_path / "work", {}

    def run(self: Commands, *words: object) -> None:
        here = [str(p.relative_to(self.folder)) for p in self.folder.rglob("*")]
        seen[str(words[0])] = (here, [str(w) for w in words])
        raise asking.NoAnswer("refused")

    monkeypatch.setattr(Commands, "run", run)
    lay_out(rig, work)
    found = asking.ask(work, rig.test, 10.0)
    assert ("refused", {}) == (found["error"], found["predicted"])
    here, words = seen["mismatch"]
    assert not [name for name in here if "answer" in name or "test" in name or "rig" in name]
    assert not [word for word in words if str(rig.folder) in word]


def test_unseen_rows_are_simulated(rig: Rig, tmp_path: Path) -> None:
    """By the command; a plant that was not adopted predicts what the shipped one does."""
    lay_out(rig, tmp_path / "work")
    found = predicted(Commands(tmp_path / "work", 60.0), rig.test)
    errors = found["boiler.Q"]
    assert ROWS - 1 == errors["rows"]
    assert 0.1 < errors["shipped"] == errors["recalibrated"] == errors["adopted"]
    with pytest.raises(asking.NoAnswer, match="no answer in 0 s"):
        Commands(tmp_path, 0.01).run("version")
    with pytest.raises(asking.NoAnswer, match="rulec compile: "):
        Commands(tmp_path, 60.0).run("compile", "nowhere", "-o", "x.json")


def test_a_command_ends_with_whoever_asked() -> None:
    """At the end of its standard input, in the middle of its work."""
    asked = [sys.executable, "-m", asking.TOOL, "check"]
    done = subprocess.run(
        asked, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert (1, "", "") == (done.returncode, done.stdout, done.stderr)


def score_of(rig: Rig, *missing: Missing, beside: tuple[str, ...] = (), **said: Any) -> Scored:
    """The score where that is missing; `effects` or a `verdict` is what the tool says."""
    found = asked(said.pop("effects", []))
    found["form"] |= said
    assert rig.truth is not None
    return scored(replace(rig, truth=replace(rig.truth, missing=missing, beside=beside)), found)


def test_a_right_name(rig: Rig) -> None:
    """Place, headline, class, size, and nothing false."""
    size = {"R": {"value": 30.0, "u": 1.0, "lower": 28.0, "upper": 32.0, "unit": "1"}}
    missing = Missing(("valve",), ("boiler",), (Size("R", 33.0, 1.0, "1"),))
    result = score_of(rig, missing, effects=[finding("valve", "boiler.x", 0.95, parameters=size)])
    shares = (result.place, result.headline, result.named, result.probability, result.utility)
    assert (1.0, 1.0, 1.0, 0.95, 1.0) == shares
    assert (1, 1) == result.inside
    assert () == result.false


@pytest.mark.parametrize(
    ("value", "unit", "hits"), [(50.0, "l/min", 1), (60.0, "l/min", 0), (3.0, "bar", 0)]
)
def test_sizes_in_other_units(rig: Rig, value: float, unit: str, hits: int) -> None:
    """50 l/min is 3 m3/h; a pressure is no flow."""
    size = {"q": {"value": 3.0, "u": 0.1, "lower": 2.8, "upper": 3.2, "unit": "m3/h"}}
    found = [finding("leak", "boiler.Q", 0.95, parameters=size)]
    missing = Missing(("leak",), ("boiler",), (Size("q", value, 0.1, unit),))
    assert (hits, 1) == score_of(rig, missing, effects=found).inside


def test_a_name_in_a_class(rig: Rig) -> None:
    """One of two that coincide is right: in its class, not in the headline; DX scores between."""
    same = {"effect": "valve", "id": "boiler.valve@x", "probability": 0.3, "same": True}
    found = [finding("line", "boiler.dp", 0.6, alternatives=[same], class_probability=0.9)]
    result = score_of(rig, Missing(("valve",), ("boiler.x",)), effects=found)
    assert (1.0, 0.0, 1.0) == (result.place, result.headline, result.named)
    assert result.utility is not None
    assert 0.5 < result.utility < 1.0


def test_false_names(rig: Rig) -> None:
    """At another place, or of another id; sure from 0.9 on; what stands beside is not false."""
    found = [
        finding("meter", "boiler.p_1", 0.97),
        finding("lag", "boiler.Q", 0.99),
        finding("drift", "boiler.Q", 0.5),
        finding("curve", "boiler.Q", 0.99, sort="free"),
    ]
    result = score_of(rig, Missing(("meter",), ("boiler.Q",)), beside=("lag",), effects=found)
    assert 0.0 == result.named
    assert ["meter", "drift"] == [f.causes[0].name for f in result.false]
    assert ["meter"] == [f.causes[0].name for f in result.sure]
    known = FalseAlarm("small", "meter", "boiler.p_1", "story", "right")
    (alarm,) = alarms([known, replace(known, rig="not asked")], [result])
    assert 0.97 == alarm.again


def test_utility_by_hand() -> None:
    """f = 10; silence: 1 - 1*(10 + 1)/(10*2); one wrong name: 1 - 2/20 - 10/20."""
    truth = (Missing(("a",), ("P",)),)
    assert utility(truth, [], 10) == pytest.approx(0.45)
    assert utility(truth, [scored_finding(finding("b", "P.x", 1.0))], 10) == pytest.approx(0.4)
    assert utility(truth, [scored_finding(finding("a", "P.x", 1.0))], 10) == pytest.approx(1.0)


def test_an_answer_without_a_name(rig: Rig) -> None:
    """Right where nothing is missing, and where no entry names what is; a rig on which the tool
    gave up is in all shares."""
    leak = [finding("leak", "boiler.Q", 0.95)]
    scores = score_of(rig, verdict="none"), score_of(rig, effects=leak, verdict="named")
    assert [(True, ()), (False, scores[1].said)] == [(t.silent, t.sure) for t in scores]
    there = [{"module": "boiler", "place": "Q"}]
    odd = score_of(rig, Missing((), ("boiler.Q",)), verdict="unnamed", locations=there)
    assert (1.0, 1.0) == (odd.place, odd.named)
    lost = scored(rig, {**asked(), "form": None, "error": "rulec mismatch: no answer in 600 s"})
    assert (0.0, 0.0, "no answer") == (lost.place, lost.named, lost.verdict)


@pytest.fixture
def result(rig: Rig) -> Result:
    both = (scored(rig, asked()), scored(rig, {**asked(), "form": None, "error": "[no] answer"}))
    alarm = FalseAlarm("small", "offset", "boiler.p_1", "it was told", "the valve")
    return Result(both, (alarm,), {"small": ["verdict: named → none"]}, "abc")


def test_results_are_told(result: Result) -> None:
    """In the terminal, as JSON and as a page."""
    out = Terminal(width=120, color_system=None)
    with out.capture() as shown:
        tell(out, result)
    said = shown.get()
    data = json.loads(json.dumps(form(result), allow_nan=False))
    html = page(result, None)
    for text in (said, html):
        assert "[no] answer" in text
        assert "it was told" in text
    assert '<figure id="rig-small"' in html
    assert "0.5 to 0.5" in said
    assert "course" not in data["rigs"]["small"]["predicted"]["boiler.Q"]
    assert ["verdict: named → none"] == data["rigs"]["small"]["hidden"]
    assert data["totals"]["place right"]["count"] == 2
    (ratio,) = (t for t in totals(result.scored) if t.title.endswith("recalibrated"))
    assert ratio.value == pytest.approx(0.5)
    assert set(MODELS) <= set(data["rigs"]["small"]["predicted"]["boiler.Q"])


def test_names_are_hidden(rig: Rig, tmp_path: Path) -> None:
    """Nothing of the old names is left, and the recording still is one of the plant."""
    work = tmp_path / "work"
    lay_out(rig, work)
    names = hide(work)
    assert {"boiler": "N001"} == names
    for file in (work / "plant" / "plant.yaml", work / "plant" / "columns.yaml"):
        assert not [w for w in ("boiler", "P101", "Gas") if w in file.read_text(encoding="utf-8")]
    rules = compile_plant(work / "plant")
    assert {"N001.Q", "N001.f"} <= set(read_recording(work / "train-1.csv", rules).values)


def test_names_are_hidden_without_a_column_map(tmp_path: Path) -> None:
    """Titles of signals keep to their modules; connections and calibrations follow."""
    shutil.copytree(ROOT / "plants" / "abc", tmp_path / "plant")
    shutil.copyfile(tmp_path / "plant" / "examples" / "calibration.csv", tmp_path / "train-1.csv")
    before = read_recording(tmp_path / "train-1.csv", compile_plant(tmp_path / "plant"))
    names = hide(tmp_path)
    assert sorted(names) == sorted(names, key=lambda n: names[n], reverse=True)
    after = read_recording(tmp_path / "train-1.csv", compile_plant(tmp_path / "plant"))
    hidden = {f"{names[n.split('.')[0]]}.{n.split('.')[1]}" for n in before.values}
    assert hidden == set(after.values)


def test_differences_under_other_names() -> None:
    """Names alone make none; a number and an effect more do."""
    one = mismatch_form(NAMED, "plant.yaml")
    module = one["effects"][0]["module"]
    text = json.dumps(one).replace(f'"{module}"', '"N001"').replace(f"{module}.", "N001.")
    other = json.loads(text)
    assert [] == differences(one, other, {module: "N001"})
    other["effects"][0]["probability"] = 0.25
    other["verdict"] = "ambiguous"
    found = differences(one, other, {module: "N001"})
    assert 2 == len(found)
    assert any(line.startswith("verdict: named → ambiguous") for line in found)
    assert any(".probability: " in line and "→ 0.25" in line for line in found)


@pytest.mark.prove
def test_the_shipped_rig(tmp_path: Path) -> None:
    """The valve is named from sheets, the pump is not strained, and other names change nothing."""
    target, work = tmp_path / "real.json", tmp_path / "work"
    words = ["--jobs=1", f"--keep={work}", f"--json={target}", "--hidden-names"]
    assert 0 == main(["prove", "--real", str(SHIPPED), *words])
    (found,) = json.loads(target.read_text(encoding="utf-8"))["rigs"].values()
    assert 1.0 == found["named"]
    assert found["probability"] >= 0.9
    assert [] == found["hidden"]
    errors = found["predicted"]["boiler.Q"]
    assert errors["adopted"] < errors["recalibrated"] < errors["shipped"]
    answer = json.loads((work / "cases" / "0000" / "answer.json").read_text(encoding="utf-8"))
    far = {s["parameter"].partition(".")[2]: s["distance"] for s in answer["strain"]}
    assert all(far.get(name, 0.0) <= 2.0 for name in ("h0", "h1", "h2"))
