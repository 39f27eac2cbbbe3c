"""A run made by hand, with everything that may come out of one."""

import numpy as np

from rulec.prove.results import Claim, Judged, Run
from rulec.prove.truth.sealed import Answer, Planted

ENTRIES = {
    "slip by viscosity": "slip-temperature",
    "filling loss": "filling-loss",
    "motor slip": "motor-slip",
    "relief valve": "relief-valve",
    "level-dependent head": "static-head",
    "valve delay": "valve-delay",
    "check-valve cracking": "check-valve",
    "overflow": "overflow-caught",
    "late transmitter": "sensor-lag",
    "leakage": "leakage",
    "zero that drifts": "zero-drift-time",
}
"""Entry of the catalogue that is right for each effect."""


LEAK = Planted(
    effect="leak",
    title="leak",
    sort="fault",
    module="A",
    place="leak",
    names=("leakage",),
    places=("A.bypass",),
    parameters={},
    gain=50.0,
)


def sealed(planted: Planted, verdict: str) -> Answer:
    """The answer of a case with one effect."""
    return Answer(
        case="a case",
        half="stationary",
        plant="a plant",
        profile="steps",
        seed=1,
        samples=300,
        verdict=verdict,
        effects=(planted,),
    )


def judged(case: str = "case", **fields: object) -> Judged:
    """A clean case of which nothing wrong was said, but for what is given."""
    usual: dict[str, object] = {
        "verdict_true": "none",
        "verdict": "none",
        "planted": (),
        "places": (),
        "said": (),
        "gain": 0.0,
    }
    return Judged(case=case, **{**usual, **fields})  # type: ignore[arg-type]


def planted(
    case: str, effect: str, gain: float, said: str | tuple[str, ...] = "", **fields: object
) -> Judged:
    """A case with one effect; `said` is the entry that was named, its own by default."""
    entry = ENTRIES.get(effect, "")
    right = float((said or entry) == entry)
    named = said if isinstance(said, tuple) else (f"{said or entry}@A.Q_geo",)
    usual: dict[str, object] = {
        "verdict_true": "named",
        "verdict": "named",
        "planted": (effect,),
        "places": ("A.Q_geo",),
        "said": named,
        "gain": gain,
        "place_right": 1.0,
        "name_right": right,
        "claims": tuple(Claim(0.95, right == 1.0) for _ in named),
    }
    return judged(case, **{**usual, **fields})


def run(count: int = 400, seed: int = 0, partition: str = "final") -> Run:
    """As many cases, half of them clean; strong effects are mostly named, weak ones rarely."""
    random = np.random.default_rng(seed)
    cases = [_clean(i, random) for i in range(count // 2)]
    cases += [_planted(i, random) for i in range(count // 2)]
    return Run(
        tuple(cases),
        partition=partition,
        seed=771,
        openings=1,
        digest="ab" * 32,
        version="06f8b4d",
        seconds=5321.0,
        notes=("two cases took longer than a minute",),
    )


def _clean(i: int, random: np.random.Generator) -> Judged:
    wrong = i in (3, 50)
    said = {"verdict": "named", "said": ("filling-loss@A.Q_geo",)} if wrong else {}
    fields = {**said, "seconds": float(random.uniform(3, 40))}
    return judged(f"clean-{i}", clean_right=float(not wrong), **fields)


def _planted(i: int, random: np.random.Generator) -> Judged:
    names, gain = list(ENTRIES), float(10 ** random.uniform(0.3, 3.6))
    effect = names[i % len(names)]
    fields = {"seconds": 9.0, "inside": (1 + (i % 18 > 0), 2)}
    if i % 10 == 9:
        right = float(random.random() < 0.85)
        fields |= {"name_right": None, "verdict_true": "unnamed"}
        fields |= {"unnamed_right": right, "said": () if right else ("free-form@A.loss",)}
        fields |= {"verdict": "unnamed" if right else "named"}
        return planted(f"odd-{i}", "jet on a probe", gain, **fields)
    if i == 77:
        fields |= {"error": "no answer within 600 s", "said": (), "name_right": 0.0}
        return planted(f"bad-{i}", effect, gain, **{**fields, "verdict": ""})
    fields["told_right"] = random.random() < 0.97
    if random.random() < np.exp(-gain / 12):
        weak = {"said": (), "claims": (), "verdict": "none", "name_right": 0.0, "place_right": 0.0}
        return planted(f"weak-{i}", effect, gain, **{**fields, **weak})
    other = ENTRIES[names[(i + 3) % len(names)]] if random.random() < 0.05 else ""
    return planted(f"named-{i}", effect, gain, other, **fields)
