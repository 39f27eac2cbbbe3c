"""The equations of the plant abc written out by hand, for any kind of number.

Floats, arrays, `uncertainties` and GTC numbers all pass: nothing but + - * / ** is used. Slopes
are differentiated by hand. Shares nothing with the compiler; SI throughout.
"""

from collections.abc import Callable, Mapping
from typing import Any

BAR, W, RPM, LITRE_PER_HOUR, ML = 1e5, 1.0, 1 / 60, 1e-3 / 3600, 1e-6
UNITS = {
    "1": 1.0,
    "bar": BAR,
    "W": W,
    "rpm": RPM,
    "l/h": LITRE_PER_HOUR,
    "ml/rev": ML,
    "ml/stroke": ML,
    "W/rpm": W / RPM,
    "l/h/rpm": LITRE_PER_HOUR / RPM,
    "l/h/bar": LITRE_PER_HOUR / BAR,
    "l/h/bar**2": LITRE_PER_HOUR / BAR**2,
    "bar/(l/h)": BAR / LITRE_PER_HOUR,
    "bar/(l/h)**2": BAR / LITRE_PER_HOUR**2,
    "W/(l/h)": W / LITRE_PER_HOUR,
    "W/(l/h)**2": W / LITRE_PER_HOUR**2,
}

Number = Any
Values = Mapping[str, Number]


class Module:
    """Observers of a module and their slopes; `loss` may be given as a number of its own."""

    def __init__(self, read: Values, parameters: Values, mixers: Number = 0.0) -> None:
        self.read, self.p, self.mixers = read, parameters, mixers
        self.loss = read["dp"] - mixers - parameters["k0"]

    def line(self) -> Number:
        return (self.loss / self.p["k2"]) ** 0.5

    def line_slope(self) -> Number:
        """Flow through the line by its loss."""
        return 0.5 / (self.loss * self.p["k2"]) ** 0.5


class Mixer(Module):
    def observers(self) -> dict[str, Number]:
        return {"resis": self.line()}


class Dosing(Module):
    """`geo` and `power` give value and slope by the pressure difference."""

    def geo(self) -> tuple[Number, Number]:
        raise NotImplementedError

    def law(self) -> tuple[Number, Number]:
        raise NotImplementedError

    def observers(self) -> dict[str, Number]:
        flow, power = self.geo()[0], self.law()[0]
        return {"pump": flow, "power": flow * self.read["P_el"] / power, "plant": self.line()}

    def slopes_by_pressure(self) -> dict[str, Number]:
        (flow, flow_slope), (power, power_slope) = self.geo(), self.law()
        by_power = flow_slope / power - flow * power_slope / power**2
        return {
            "pump": flow_slope,
            "power": self.read["P_el"] * by_power,
            "plant": self.line_slope(),
        }

    def slope_by_power(self) -> Number:
        return self.geo()[0] / self.law()[0]


class ProgressiveCavity(Dosing):
    def geo(self) -> tuple[Number, Number]:
        p, n, dp = self.p, self.read["n"], self.read["dp"]
        return n * p["V"] - (p["C0"] + p["C1"] * n + p["C2"] * dp**2), -2 * p["C2"] * dp

    def law(self) -> tuple[Number, Number]:
        p, n, dp = self.p, self.read["n"], self.read["dp"]
        return p["P0"] + p["P1"] * n + n * p["V"] * dp / p["eta"], n * p["V"] / p["eta"]


class Membrane(ProgressiveCavity):
    def geo(self) -> tuple[Number, Number]:
        p, n, dp = self.p, self.read["n"], self.read["dp"]
        return n * p["V"] - (p["C0"] + p["C1"] * n + p["C2"] * dp), -1 * p["C2"]


class Centrifugal(Dosing):
    def geo(self) -> tuple[Number, Number]:
        p, nu = self.p, self.read["n"] / self.p["n0"]
        root = (p["h1"] ** 2 + 4 * p["h2"] * (p["h0"] - self.read["dp"] / nu**2)) ** 0.5
        return nu * (root - p["h1"]) / (2 * p["h2"]), -1 / (nu * root)

    def law(self) -> tuple[Number, Number]:
        p, nu = self.p, self.read["n"] / self.p["n0"]
        flow, slope = self.geo()
        value = nu**3 * p["p0"] + nu**2 * p["p1"] * flow - nu * p["p2"] * flow**2
        return value, (nu**2 * p["p1"] - 2 * nu * p["p2"] * flow) * slope


TYPES: Mapping[str, type[Dosing]] = {
    "dosing-pcp": ProgressiveCavity,
    "dosing-membrane": Membrane,
    "dosing-centrifugal": Centrifugal,
}


class Abc:
    """Modules A and B feed mixer C; readings and parameters by id such as ``A.dp``."""

    def __init__(self, kinds: Mapping[str, type[Dosing]], values: Values) -> None:
        def part(name: str) -> dict[str, Number]:
            return {k.partition(".")[2]: v for k, v in values.items() if k.startswith(f"{name}.")}

        mixer = part("C")
        self.modules: dict[str, Any] = {
            name: kind(part(name), part(name), mixer["dp"]) for name, kind in kinds.items()
        }
        self.modules["C"] = Mixer(mixer, mixer)
        self.misfit = {k: v for k, v in values.items() if k.endswith("~")}

    def observers(self) -> dict[str, Number]:
        found = {
            f"{name}.{observer}": flow
            for name, module in self.modules.items()
            for observer, flow in module.observers().items()
        }
        return {name: flow + self.misfit.get(f"{name}~", 0.0) for name, flow in found.items()}

    def target(self, fault: str) -> tuple[Number, dict[str, Number]]:
        """What a fault scales, and the slopes by it of all observers that it reaches."""
        name, _, kind = fault.partition(".")
        module = self.modules[name]
        line = "resis" if name == "C" else "plant"
        if kind in ("clogging", "widening"):
            return module.loss, {f"{name}.{line}": module.line_slope()}
        if kind.startswith("P_el"):
            return module.read["P_el"], {f"{name}.power": module.slope_by_power()}
        if name == "C":
            slopes = {f"{m}.plant": -1 * self.modules[m].line_slope() for m in "AB"}
            return module.read["dp"], {"C.resis": module.line_slope(), **slopes}
        slopes = module.slopes_by_pressure()
        return module.read["dp"], {f"{name}.{o}": s for o, s in slopes.items()}


def degree_law(fault: str) -> Callable[[Number, Number], Number]:
    """Degree from what is there and what is there too much."""
    if fault.endswith("leakage"):
        return lambda g, excess: excess / g
    if fault.endswith(("clogging", "high")):
        return lambda g, excess: excess / (g - excess)
    return lambda g, excess: -1 * excess / (g - excess)
