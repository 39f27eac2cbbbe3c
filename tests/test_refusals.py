"""What is refused on the command line: exit code, a message that helps on, and nothing written."""

import shlex
from pathlib import Path

import pytest

from rulec.cli import main
from tests.conftest import ROOT, Capsys
from tests.curves.test_import_curve import NB

ABC, TANKS = "plants/abc", "plants/cascaded-tanks"
HEALTHY, LEAKAGE = f"{ABC}/examples/healthy.csv", f"{ABC}/examples/leakage_A.csv"
INPUTS = f"{TANKS}/examples/inputs.csv"
PREDICT, DEGREE = f"simulate {ABC} {HEALTHY} -o out.csv", "write <module>.<fault>=<degree>"
MISMATCH, PERIOD = f"mismatch {ABC} {HEALTHY}", "give two numbers of seconds"
CURVE = "import curve sheet.csv --type metered-centrifugal -o own.yaml"
HEAD = f'{CURVE} --columns "Q [m3/h],H [m],,,,,n [rpm]"'

REFUSED = [
    # a word that is misspelt, a plant that is not there
    ("chek x", 2, "there is no 'chek'; did you mean 'check'?"),
    ("init plnt x", 2, "there is no 'plnt'; did you mean 'plant'?"),
    ("check nowhere", 1, "`rulec init plant NAME` makes a new plant"),
    (f"check {HEALTHY}", 2, "PLANT RECORDING"),
    (f"check {ABC} plants/README.md", 1, "there is no time column"),
    ("init plant yours --like cooling", 1, "no plant 'cooling' is shipped; take one of cooling-"),
    ("init module pump --like cooling-loop", 1, "--like names a plant"),
    ("show nothing", 2, "rulec show: there is no pass 'nothing'"),
    ("show differentiate", 2, "which plant? give rulec show differentiate PLANT"),
    # standard output holds one thing, and no folder; quiet tells mistakes all the same
    (
        f"diagnose {ABC} {LEAKAGE} --json - --trace -", 2,
        "rulec diagnose: only one of --json and --trace can go to standard output\n",
    ),
    (f"simulate {ABC} {ABC}/examples -o -", 2, "-o -: the inputs are a folder"),
    (f"diagnose {ABC} nowhere.csv --quiet", 1, "rulec: nowhere.csv: there is no such file"),
    # what is no recording or ruleset, and files that cannot be written
    ("diagnose nothing.json x.csv", 1, "nothing.json"),
    (f"diagnose {ABC} /dev/null", 1, "rulec: /dev/null"),
    (f"diagnose {ABC} plants/README.md", 1, "no time column"),
    (f"diagnose {HEALTHY} {HEALTHY}", 1, "healthy.csv"),
    (f"diagnose {ABC} {HEALTHY} --json /nowhere/out.json", 2, "--json /nowhere"),
    (f"diagnose {ABC} {HEALTHY} --trace /nowhere/out.csv", 2, "--trace /nowhere"),
    (f"diagnose {ABC} {HEALTHY} --report no/r.html", 2, "make it first"),
    (f"diagnose {ABC} {HEALTHY} --truth no.csv", 1, "no.csv: No such file"),
    (f"diagnose {ABC}", 2, "usage"),
    (f"diagnose {ABC} x.csv --mode guess", 2, "usage"),
    # predicted recordings
    (f"{PREDICT} --fault A.leakage", 2, DEGREE),
    (f"{PREDICT} --fault A.leakage=nan", 2, DEGREE),
    (f"{PREDICT} --fault A.leakage=0.2@9:3", 2, "the period ends before it begins"),
    (f"{PREDICT} --fault A.leakage=0.2@900:", 1, "the recording runs from 0 s to 59 s"),
    (f"{PREDICT} --fault A.leakage=-0.2", 1, "give a degree from 0 to 1, where 0.2 is"),
    (f"{PREDICT} --fault A.leek=0.2", 1, "no fault 'A.leek'; did you mean 'A.leakage'?"),
    (f"{PREDICT} --noise -1", 2, "--noise -1"),
    (f"simulate {ABC} sheet.csv -o sheet.csv", 2, "would overwrite the inputs"),
    (f"simulate {ABC} sheet.csv -o .", 2, "give the name of a file"),
    (f"simulate {ABC} . -o sheet.csv", 2, "give the name of a folder"),
    (f"simulate {ABC} {HEALTHY} -o none/out.csv", 1, "make it first"),
    # separation
    (f"matrix {ABC} --limits l.yaml", 2, "rulec matrix: --limits are limits of --separate"),
    (f"matrix {ABC} --separate --limits none.yaml", 1, "KB001"),
    (f"matrix {TANKS} --separate", 1, "storage"),
    # study, and where it runs
    (f"study {ABC} --degrees ten", 2, "--degrees ten: give numbers with commas between"),
    (f"study {ABC} --degrees nan", 2, "--degrees nan: a degree is a number above 0"),
    (f"study {ABC} --degrees 50", 2, "--degrees 50: no fault of abc has such a degree"),
    (f"study {ABC} --json no/file.json", 2, "--json no/file.json: there is no folder"),
    (f"study {ABC} --points 0", 2, "--points 0: give 1 or more"),
    (f"study {ABC} --lead-in -5", 2, "--lead-in -5: give 0 or more"),
    ("study abc.ruleset.json", 2, "abc.ruleset.json: give the plant's folder"),
    (f"study {ABC} --scheduler tcp://x:1", 2, "--scheduler is an address for --engine dask"),
    # mismatch
    ("mismatch abc.ruleset.json x.csv", 2, "abc.ruleset.json: give the plant's folder"),
    (f"{MISMATCH} --series no/m.x", 2, "no/m.x: there is no folder 'no'; make it first"),
    (f"{MISMATCH} {HEALTHY}", 1, "same file, given twice"),
    (f"mismatch {TANKS} {INPUTS} {INPUTS}", 1, "this plant has storage"),
    (f"{MISMATCH} --power A.leak", 1, "no effect of this plant has that id; did you mean 'A.leak"),
    (f"{MISMATCH} --heldout=last", 2, f"last: {PERIOD} with a colon between, as in 600:900\n"),
    (f"{MISMATCH} --heldout=1:2:3", 2, f"--heldout 1:2:3: {PERIOD}"),
    (f"{MISMATCH} --heldout=1:inf", 2, f"--heldout 1:inf: {PERIOD}"),
    (f"{MISMATCH} --heldout=:", 2, f"--heldout :: {PERIOD}"),
    (f"{MISMATCH} --heldout=9:3", 2, "9:3: it ends before it begins; did you mean 3:9?"),
    (f"{MISMATCH} --heldout=3:3", 2, "--heldout 3:3: it has no length"),
    (f"{MISMATCH} --heldout=500:600", 1, "the recording has no sample there; it runs from 0 s to"),
    (f"{MISMATCH} --heldout=-1:1e6", 1, "--heldout takes the whole recording; leave a part"),
    # a sheet of a maker whose columns do not fit
    (f'{CURVE} --columns "Q [m3/h],H,,,P_el [kW],,n [rpm]"', 1, "column 'H' names no unit"),
    (f'{CURVE} --columns "Q [m3/h],H [furlong],,,,,n [rpm]"', 1, "unknown unit 'furlong'"),
    (f'{CURVE} --columns "dp [bar],n [m],,,,,Q [m3/h]"', 1, "are two columns swapped?"),
    (
        f'{CURVE} --columns "Q [m3/h],H [m],,P1 [kW],input power [kW],,n [rpm]"',
        1,
        "each could be P_el",
    ),
    (f'{CURVE} --columns "Q [m3/h],H [m],,,P_el [kW],,"', 1, "dp_law lacks n [rpm]"),
    (f'{CURVE} --columns "Q [m3/h],,,,,,"', 1, "no law of metered-centrifugal can be fitted"),
    (f"{HEAD} --grade 9Z", 1, "give 1B, 2B, 3B, or a share"),
    (f"{HEAD} --at n0", 1, "write NAME=VALUE UNIT"),
    (f'{HEAD} --at "x=3 rpm"', 1, "has no 'x'"),
]  # fmt: skip

SHEET = CURVE.replace("sheet.csv", "given.csv")
ADOPT = "adopt given.json -o new"
SIMULATE = f"simulate {TANKS} given.csv -o out.csv"
OTHERS = "simulate plants/{} given.csv -o out.csv"
FILES = [
    (SHEET, "", "empty"),
    (SHEET, "1,2\n3,4\n5,6\n", "its columns have no titles"),
    (SHEET, "Q [m3/h],dp [bar],n [rpm]\n1,2,3\n2,3,4\n", "4 are needed"),
    (SHEET, "Q [m3/h],dp [bar],n [rpm]\n" + "nan,inf,3\n" * 9, "only 0 points"),
    (SHEET, "Q [m3/h],dp [bar],n [rpm]\n" + "1,2,2900\n" * 2001, "is for rulec calibrate"),
    (SHEET, "\x00\x01\x02", "given.csv"),
    (ADOPT, "no json", "this is not a result of"),
    (ADOPT, '{"repair": {"plant": "nowhere"}}', "broken (KeyError: 'parameters')"),
    (
        ADOPT,
        '{"repair": {"plant": "nowhere", "joined": [], "parameters": ["A.k2"], "values": [], '
        '"covariance": []}}',
        "1 parameters, but other numbers",
    ),
    (f"diagnose {ABC} given.csv", "", "the file is empty"),
    (f"diagnose {ABC} given.csv", "time [s],PS1 [bar]\n0,160\n", "no column belongs to this plant"),
    (
        OTHERS.format("abc"),
        "time [s],A.n [rpm]\n0,900\n",
        "of abc, it needs the column 'B.n [rpm]'",
    ),
    (
        OTHERS.format("zema-hydraulic"),
        "time [s],FS1 [l/min]\n0,7\n",
        "it needs the columns 'PS1 [bar]', 'TS1 [degC]'",
    ),
    (SIMULATE, "time [s],y [V]\n0,1\n", "it needs the column 'u [V]'"),
    (SIMULATE, "time [s],u [V]\n0,\n4,\n", "pump.u has not one reading"),
    (f"{SIMULATE} --fault pump.leek=0.1", "time [s],u [V]\n0,1\n", "has no fault 'pump.leek'"),
]
"""A command, the content of the file that it is given, and what is told."""


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped plants and a maker's sheet; one folder, as compiled plants are kept by path."""
    folder = tmp_path_factory.mktemp("typed")
    (folder / "plants").symlink_to(ROOT / "plants")
    (folder / "sheet.csv").write_text(NB, encoding="utf-8")
    return folder


@pytest.fixture
def folder(beside: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where commands are typed."""
    monkeypatch.chdir(beside)
    monkeypatch.setenv("COLUMNS", "120")
    return beside


def refused(line: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit code and what is told; no file was written, or written anew."""
    before = [(file, file.stat().st_mtime_ns) for file in sorted(folder.iterdir())]
    try:
        code = main(shlex.split(line))
    except SystemExit as ended:
        code = int(str(ended.code))
    assert before == [(file, file.stat().st_mtime_ns) for file in sorted(folder.iterdir())]
    shown = capsys.readouterr()
    assert "" == shown.out or line.startswith("check")
    return code, shown.out + shown.err


@pytest.mark.parametrize(("line", "code", "said"), REFUSED)
def test_a_command_is_refused(
    line: str, code: int, said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found, output = refused(line, folder, capsys)
    assert code == found
    assert said in output
    assert "--heldout" not in line or 1 == len(output.splitlines())


@pytest.mark.parametrize(("line", "text", "said"), FILES)
def test_a_file_is_refused(line: str, text: str, said: str, folder: Path, capsys: Capsys) -> None:
    (name,) = (word for word in line.split() if word.startswith("given."))
    (folder / name).write_text(text, encoding="utf-8")
    code, output = refused(line, folder, capsys)
    assert code == 1
    assert said in output
