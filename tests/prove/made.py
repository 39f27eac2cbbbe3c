"""A run made by hand, with everything that may come out of one."""

from rulec.prove.results import Claim, Judged, Run
from rulec.prove.truth.sealed import Answer, Planted

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
    """A case with one effect; `said` is the entry that was named, that of its name by default."""
    right = float((said or effect) == effect)
    named = said if isinstance(said, tuple) else (f"{said or effect}@A.Q_geo",)
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


def run(count: int, partition: str = "final") -> Run:
    """As many cases, every other one clean; of the others those that are named, wrongly named,
    missed, without a name or without an answer come in turn, stronger and stronger."""
    gone: dict[str, object] = {"said": (), "claims": (), "verdict": "none", "name_right": 0.0}
    odd = {**gone, "name_right": None, "verdict_true": "unnamed", "unnamed_right": 1.0}
    kinds: tuple[dict[str, object], ...] = (
        {"inside": (1, 2), "told_right": True},
        {"said": "filling-loss", "told_right": False},
        {**gone, "place_right": 0.0},
        {**odd, "verdict": "unnamed"},
        {**gone, "verdict": "", "error": "no answer within 600 s"},
    )
    cases = []
    for i in range(count):
        fields: dict[str, object] = {"seconds": 3.0 + i, **kinds[i // 2 % len(kinds)]}
        if i % 2:
            cases.append(planted(f"case-{i}", "leakage", 2.0 * 1.1**i, **fields))  # type: ignore[arg-type]
        else:
            cases.append(judged(f"clean-{i}", clean_right=1.0, seconds=3.0 + i))
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
