"""How often this recording would reveal an effect, in replays by the plant's own model.

Replays contain nothing, or one of the possible or requested explanations. No sample of the real
recording decides here: only its inputs, its noise, and prior knowledge.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.evidence import Column, Evidence, Random, amplitudes_of, id_of
from rulec.mismatch.inference import limits
from rulec.mismatch.inference.judge import Judge
from rulec.mismatch.result import Detectability, SelfProof
from rulec.mismatch.search import limits as of_search
from rulec.mismatch.search.posterior import Posterior, titled_with_module
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.scan import indices_of

# Replays of a recording by the plant's own model.
#
# Only its conditions count: inputs, noise, and possible errors of sensors, parameters and laws.
# Its readings do not.


def without_explanations(evidence: Evidence, model: Model) -> Model:
    """A model with its values and its sizes of errors, but without explanations.

    Replays use the values believed with the explanations: without those, the same model would need
    larger errors.
    """
    setting = model.setting
    for candidate in setting.joined:
        setting = setting.leaving(candidate.id)
    prior = evidence.prior(setting)
    at = np.clip(prior.of(setting.values), prior.lowest, prior.highest)
    now = evidence.evaluated(setting, prior, at)
    random = Random(evidence.forms, evidence.law, evidence.moving, evidence.held, ())
    sizes = replace(model.sizes, terms=())
    raw = np.concatenate([now.jacobian, random.columns * random.ratio(sizes)], axis=1)
    precision = np.eye(raw.shape[1])
    precision[: len(at), : len(at)] = prior.near(at).precision
    return replace(
        model,
        point=now,
        prior=prior,
        mean=at,
        at=at,
        terms=(),
        sizes=sizes,
        table=evidence.whitened(raw, model.noise),
        left=np.zeros(len(raw)),
        raw=raw,
        off=np.zeros(len(raw)),
        precision=precision,
        weights=evidence.expected_weights(model.noise),
    )


def drawn(judge: Judge, count: int, shift: Array, seed: int = 0) -> Array:
    """Replays of the whitened rows: residuals at the means of the values, shape (rows, count).

    `shift`, shape (rows, 1) or (rows, count), is the effect of a concealed explanation on them.
    """
    model, rng = judge.model, np.random.default_rng(seed)
    # Parameters of a plant have very different units: their precision is scaled first.
    unit = np.sqrt(np.diag(model.precision))
    lower = np.linalg.cholesky(model.precision / np.outer(unit, unit))
    normal = rng.standard_normal((len(unit), count))
    values = np.linalg.solve(lower.T, normal) / unit[:, None]
    size = judge.evidence.expected_weights(model.noise) ** -0.5
    noise = size[:, None] * rng.standard_normal((len(size), count))
    return np.asarray(noise - model.table @ values - shift)


NAMELESS = "something without a name"


def called_missing(judge: Judge, replays: Array) -> int:
    """The number of replays, shape (rows, replays), in which something counts as missing."""
    judged = judge.judged(replays)
    return int(((judged.nothing < of_search.LIKELIER) | judged.sure).sum())


def asked_of(
    judge: Judge, concealed: Sequence[int], size: float, count: int
) -> tuple[int, Counter[str]]:
    """The number of replays in which an effect of a size, SI, is found, and what else is found, by
    title.

    `concealed` are the numbers of its columns. An unknown shape is drawn anew in each replay, by
    its prior.
    """
    rng = np.random.default_rng(1)
    own = np.array(concealed)
    share = np.exp(judge.odds[own] - judge.odds[own].max())
    chosen = rng.choice(own, count, p=share / share.sum())
    replays = drawn(judge, count, judge.rows[:, chosen] * size)
    judged = judge.judged(replays)
    best, sure = judged.best, judged.sure
    names = np.append(judge.owner, np.full(len(judge.terms), ""))
    named = best < len(judge.columns)
    index = np.where(named, best, 0)
    right = named & ((names[best] == judge.owner[own[0]]) | judge.alike[index, chosen])
    titles = {c.candidate.id: titled_with_module(c.candidate) for c in judge.columns}
    other = Counter(titles.get(str(names[b]), NAMELESS) for b in best[sure & ~right])
    return int((sure & right).sum()), other


def seen_from(judge: Judge, concealed: Sequence[int], usual: float) -> float | None:
    """The smallest size, SI, that is found in enough of the replays; None if there is none."""
    end = judge.ends[1 if usual > 0.0 else 0][concealed[0]]
    count = limits.SEEN_REPLAYS

    def enough(size: float) -> bool:
        return asked_of(judge, concealed, size, count)[0] >= limits.SEEN * count

    last = usual if abs(usual) < abs(end) else end
    way = 0.5 if enough(last) else 2.0
    for _ in range(limits.SEEN_REACH):
        there = last * way if abs(last * way) < abs(end) else end
        if enough(there) == (way > 1.0):
            break
        if there == end:
            return None
        last = there
    else:
        return None if way > 1.0 else last
    low, high = sorted((last, there), key=abs)
    for _ in range(limits.SEEN_STEPS):
        middle = np.copysign(np.sqrt(low * high), usual)
        low, high = (low, middle) if enough(middle) else (middle, high)
    return float(high)


def found_columns(posterior: Posterior) -> dict[str, tuple[Column, float]]:
    """Columns of explanations by id, as found in the most probable set with them, each with its
    size, SI: laws are linearised at that size, along their first amplitude."""
    found: dict[str, tuple[Column, float]] = {}
    odds, evidence = posterior.odds, posterior.evidence
    for names in sorted(odds, key=lambda names: (-odds[names], sorted(names))):
        model = posterior.models[names]
        for candidate in (c for c in model.setting.joined if c.id not in found):
            first = next((u for u in amplitudes_of(candidate) if indices_of(model, u.id)), None)
            if first is None:
                continue
            null = first.null or 0.0
            off = [float(model.at[i] - null) for i in indices_of(model, first.id)]
            size = max(off, key=abs)
            if size == 0.0:
                continue
            setting = model.setting.leaving(candidate.id)
            prior = evidence.prior(setting)
            without = evidence.evaluated(setting, prior, prior.of(setting.values))
            shift = model.point.residual - without.residual
            if np.isfinite(shift).all() and shift.any():
                courses = model.setting.courses
                column = Column(
                    candidate=candidate,
                    amplitude=first,
                    values={},
                    fixed={},
                    rows=shift / size,
                    course=next((c for c in courses if c.unknown == first.id), None),
                )
                found[candidate.id] = column, size
    return found


def judge_of(posterior: Posterior) -> Judge:
    """The judge of replays of a recording."""
    evidence = posterior.evidence
    model = without_explanations(evidence, posterior.models[posterior.selected])
    found = [column for column, _ in found_columns(posterior).values()]
    return Judge(
        evidence=evidence,
        model=model,
        columns=[*found, *evidence.columns(model.point, evidence.candidates)],
        terms=evidence.terms(model.point),
        candidates=len({c.id for c in evidence.candidates}),
    )


def self_proof(
    posterior: Posterior, every: Sequence[Candidate], asked: Sequence[str] = ()
) -> SelfProof:
    """How often something is found in replays: with nothing missing, and with effects concealed.

    `asked` are ids of some of `every` candidate of the plant; without any, all explanations that
    are probable enough to be mentioned.
    """
    names = posterior.names
    likely = [n for n in sorted(names, key=lambda n: -names[n]) if names[n] >= common.MENTIONED]
    ids = list(dict.fromkeys(asked or (id_of(n) for n in likely if "~" not in n)))
    judge, found = judge_of(posterior), found_columns(posterior)
    possible = {id_of(name) for name, p in names.items() if p >= common.REPORTED}
    sizes = {id_: size for id_, (_, size) in found.items() if id_ in possible}
    replays = drawn(judge, limits.REPLAYS, np.zeros((len(judge.model.left), 1)))
    titles = {c.id: titled_with_module(c) for c in every}
    return SelfProof(
        replays=limits.REPLAYS,
        called_missing=called_missing(judge, replays),
        effects=tuple(_detectability(judge, i, sizes, titles.get(i, i)) for i in ids),
    )


def _detectability(judge: Judge, id_: str, found: Mapping[str, float], title: str) -> Detectability:
    """How often one effect is found; an effect without influence on readings has no size."""
    own = [i for i, c in enumerate(judge.columns) if c.candidate.id == id_]
    if not own:
        return Detectability(id=id_, title=title)
    first = judge.columns[own[0]]
    size = found.get(id_)
    # The column as found comes first.
    same = [i for i in own if judge.columns[i].amplitude.id == first.amplitude.id]
    concealed = same if size is None else own[:1]
    prior, (low, high) = judge.evidence.size(first.candidate, first.amplitude), judge.ends
    # The usual size has the sign found, else a possible one.
    sign = size if size is not None else 1.0 if high[own[0]] > 0.0 else -1.0
    usual = np.copysign(prior.usual or prior.scale, sign)
    usual = float(np.clip(usual, low[own[0]], high[own[0]]))
    at = usual if size is None else size
    told, other = asked_of(judge, concealed, at, limits.REPLAYS)
    told_usual = told if size is None else asked_of(judge, concealed, usual, limits.REPLAYS)[0]
    least = seen_from(judge, concealed, usual)
    factor = first.amplitude.factor
    return Detectability(
        id=id_,
        title=titled_with_module(first.candidate),
        size=abs(at) / factor,
        unit=first.amplitude.unit,
        told=told,
        other=dict(other.most_common()),
        usual=abs(usual) / factor,
        told_usual=told_usual,
        seen_from=None if least is None else abs(least) / factor,
        found=size is not None,
    )
