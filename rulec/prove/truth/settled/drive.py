"""Operation of plants: settings between 0 and 1 of their range, slow temperatures and levels."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..smooth import held
from ..units import ZERO_CELSIUS, Array

COLD, WARM = 18.0 + ZERO_CELSIUS, 42.0 + ZERO_CELSIUS
LIGHT, HEAVY = 1000.0, 1200.0
"""kg/m3; water and a strong brine."""

LOW, HIGH = 0.15, 0.8
"""m; level of a feed tank."""

MEMORY = 25.0
"""Samples within which a temperature follows the load."""


def ramps(random: np.random.Generator, samples: int) -> Array:
    """Slow ramps between plateaus."""
    corners = [0]
    values = [float(random.uniform())]
    while corners[-1] < samples:
        corners += [corners[-1] + int(random.integers(8, 25))]
        values += [values[-1]]
        corners += [corners[-1] + int(random.integers(15, 60))]
        values += [float(random.uniform())]
    return np.asarray(np.interp(np.arange(samples), corners, values))


FEW = 3, 6
"""Least and most operating states of a plant with few of them."""


def few_states(
    random: np.random.Generator, modules: Sequence[str], samples: int
) -> dict[str, Array]:
    """All modules change together between a few states, each visited once or twice."""
    count = int(random.integers(FEW[0], FEW[1] + 1))
    order = np.concatenate([np.arange(count), random.permutation(count)])
    order = order[: int(random.integers(count, 2 * count + 1))]
    cuts = np.linspace(0.0, samples, order.size + 1)[:-1]
    held = np.searchsorted(cuts, np.arange(samples), side="right") - 1
    return {m: np.asarray(random.uniform(size=count)[order[held]]) for m in modules}


PRODUCTION = "production"
"""Profile of a plant that makes its few products."""

PART = 0.3
"""Share of the range of a setting that production uses."""


def products(random: np.random.Generator, modules: Sequence[str], samples: int) -> dict[str, Array]:
    """All modules change together between a few products, each within a part of its range."""
    runs = few_states(random, modules, samples)
    return {m: random.uniform(0.0, 1.0 - PART) + PART * run for m, run in runs.items()}


HELD = {"steps": (8, 30), "start-stop": (8, 30), "long-constant": (70, 160), "visits": (12, 18)}
"""Least and most samples for which random values are held; `visits` are as for a calibration."""

TOGETHER: Mapping[str, Callable[[np.random.Generator, Sequence[str], int], dict[str, Array]]] = {
    "few-states": few_states,
    PRODUCTION: products,
}
"""Profiles in which all modules change together."""


def course(random: np.random.Generator, profile: str, samples: int) -> Array:
    """Draw the course of a single setting, 0 to 1, shape (samples,)."""
    if profile in TOGETHER:
        return TOGETHER[profile](random, ["alone"], samples)["alone"]
    return held(random, samples, *HELD[profile]) if profile in HELD else ramps(random, samples)


def shares(
    random: np.random.Generator, modules: Sequence[str], profile: str, samples: int, before: int
) -> dict[str, Array]:
    """Draw the course of each module's setting, 0 to 1, shape (before+samples,)."""
    together = TOGETHER[profile](random, modules, samples) if profile in TOGETHER else {}
    found = {}
    for m in modules:
        first = course(random, "visits", before)
        own = together[m] if together else course(random, profile, samples)
        found[m] = np.concatenate([first, own])
    return found


def stops(random: np.random.Generator, samples: int) -> Array:
    """1 while the plant runs, else 0: it stops for 15 to 40 samples now and then."""
    running, at = np.ones(samples), int(random.integers(40, 100))
    while at < samples:
        until = at + int(random.integers(15, 40))
        running[at:until] = 0.0
        at = until + int(random.integers(60, 160))
    return running


def temperature(random: np.random.Generator, samples: int) -> Array:
    """A warm-up and a daily swing, K."""
    time = np.arange(samples) / samples
    warm = 1.0 - np.exp(-time / random.uniform(0.1, 0.4))
    swing = np.sin(2.0 * np.pi * (random.uniform(0.8, 2.0) * time + random.uniform()))
    raw = warm + random.uniform(0.3, 0.8) * swing
    span = random.uniform(0.5, 1.0) * (WARM - COLD)
    return np.asarray(COLD + span * (raw - raw.min()) / np.ptp(raw))


def by_load(random: np.random.Generator, load: Array) -> Array:
    """A temperature that follows the load of the pump within minutes, K."""
    result = _followed(load, MEMORY)
    share = (result - result.min()) / max(float(np.ptp(result)), 1e-9)
    return np.asarray(COLD + (WARM - COLD) * (0.15 + 0.7 * share) + 0.3 * random.uniform(-1, 1))


def density(random: np.random.Generator, samples: int) -> Array:
    """Successive batches of other concentration, each mixed in within some samples, kg/m3."""
    return _followed(LIGHT + (HEAVY - LIGHT) * held(random, samples, 40, 120), 4.0)


def _followed(values: Array, samples: float) -> Array:
    """What follows a course within so many `samples`, settled at the first one."""
    last, result = float(values[0]), np.empty(values.size)
    for k, now in enumerate(values.tolist()):
        last += (now - last) / samples
        result[k] = last
    return result


def level(random: np.random.Generator, samples: int) -> Array:
    """Level of a tank that is emptied and refilled, m."""
    period = random.uniform(0.25, 0.6) * samples
    phase = (np.arange(samples) / period + random.uniform()) % 1.0
    return np.asarray(HIGH - (HIGH - LOW) * phase)


SPEED_TIME = 1.0
"""Time constant, s; assumed: a converter's speed ramp."""


def approach(time: Array, setting: Array, time_constant: float) -> Array:
    """Return the first-order approach to a setting, settled at the first sample; shape (n,).

    The setting of a sample holds since the sample before.

    Source: exact solution of `time_constant dy/dt = setting - y` for a constant setting.
    """
    value = np.array(setting, dtype=np.float64)
    for k, left in enumerate(np.exp(-np.diff(time) / time_constant), start=1):
        value[k] = setting[k] + left * (value[k - 1] - setting[k])
    return value


def late(value: Array, by: int) -> Array:
    """Delay a course by `by` samples; it begins with its first value; shape (n,)."""
    return np.concatenate([np.full(by, value[0]), value[:-by]])
