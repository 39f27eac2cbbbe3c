"""Commands as a user types them, and a plant that is commissioned by them."""

import contextlib
import io
from pathlib import Path

from rulec.cli import main
from tests.conftest import ROOT


def called(*words: object, codes: tuple[int, ...] = (0,)) -> None:
    """A command, quietly: what it says is shown where it fails."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = main([str(word) for word in words])
    assert code in codes, said.getvalue()


def commissioned(plant: Path, recording: Path, *options: str) -> None:
    """Calibrate by a recording, in place of the calibration that the file of a plant states."""
    lines = plant.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith("calibration:")]
    text = "\n".join([*kept, f"kb: {ROOT / 'kb'}"]) + "\n"
    plant.write_text(text, encoding="utf-8")
    called("calibrate", plant, recording, "-o", plant.parent / "found.yaml", *options)
    plant.write_text(f"{text}calibration: [found.yaml]\n", encoding="utf-8")
