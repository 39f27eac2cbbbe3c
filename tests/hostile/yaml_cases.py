"""Hostile knowledge and plant files."""

from collections.abc import Callable, Iterator

from tests.hostile.case import Case, Content
from tests.hostile.texts import ESCAPED, MARKUP

PLANT = """plant: p
title: "{title}"
modules:
  A: {{type: dosing-pcp, title: "{module}"}}
  B: {{type: dosing-pcp}}
  C: {{type: static-mixer}}
connections: [A -> C, B -> C]
{more}
"""

MODULE = """module: bomb
version: 1
title: "{title}"
signals:
  n:
    {{quantity: rotational speed, unit: rpm, sensor: converter-speed, input: true, reference: 900}}
  dp:
    {{quantity: pressure difference, unit: bar, sensor: piezoresistive, range: [0, 9],
    reference: 2}}
parameters:
  V:  {{value: 10, unit: ml/rev, u: 0.1, source: "{source}"}}
  q:  {{value: 100, unit: l/h/bar, u: 1, source: own}}
definitions:
  d0: {{is: dp}}
{definitions}
observers:
  pump:  {{component: pump, Q: n*V, source: own}}
  plant: {{component: line, Q: q*{last}, source: own}}
"""

STEPS: dict[str, Callable[[str], str]] = {
    "max and min": lambda d: f"max({d}, 2*dp) + min({d}, dp)",
    "max": lambda d: f"max({d}, 2*dp)",
    "product": lambda d: f"{d}*(1 + {d}/dp)",
    "sum": lambda d: f"{d} + {d}",
    "chain": lambda d: f"{d} + dp",
    "tanh": lambda d: f"dp*tanh({d}/dp)",
    "root": lambda d: f"sqrt({d}*dp)",
    "fraction": lambda d: f"dp*dp/({d} + dp)",
    "power": lambda d: f"({d} + dp)**8/dp**7",
    "exp": lambda d: f"dp*exp({d}/dp)",
    "log": lambda d: f"dp*log({d}/dp + 2)",
    "size": lambda d: f"abs({d}) + abs({d} - dp)",
}


def plant(title: str = "t", module: str = "m", more: str = "") -> str:
    return PLANT.format(title=title, module=module, more=more)


def module(definitions: str = "", last: str = "d0", title: str = "t", source: str = "own") -> str:
    return MODULE.format(definitions=definitions, last=last, title=title, source=source)


def bomb(step: Callable[[str], str], count: int) -> str:
    lines = [f"  d{i}: {{is: '{step(f'd{i - 1}')}'}}" for i in range(1, count + 1)]
    return module("\n".join(lines), f"d{count}")


def check(family: str, name: str, text: Content, file: str = "plant.yaml") -> Case:
    return Case(family, name, ("check", file), {file: text})


def cases() -> Iterator[Case]:
    family = "control characters in YAML"
    for name, text in ESCAPED.items():
        yield check(family, f"{name} in a title", plant(title=text, module=text))
        yield check(family, f"{name} as a key", plant(more=f'"{text}": 1'))
    text = ESCAPED["escape"]
    yield check(family, "as a file", plant(more=f'columns: "{text}"'))
    yield check(family, "in a source", module(source=text), "bomb.yaml")
    yield check(family, "as a unit", module().replace("ml/rev", f'"{text}"'), "b.yaml")
    for i, text in enumerate(MARKUP):
        quoted = text.replace("\\", "\\\\")
        files = {"p/plant.yaml": plant(title=quoted, module=quoted)}
        out = f"x{i}{text.replace('/', '')}"
        yield Case("markup", f"{i} in a title, compiled", ("compile", "p", "-o", out), files)
        yield Case("markup", f"{i} in a title, shown", ("matrix", "p"), files)
        yield Case("markup", f"{i} as a plant", ("check", text))
    for name, step in STEPS.items():
        yield check("definition bombs", name, bomb(step, 300), "bomb.yaml")
    yield check("definition bombs", "a short one", bomb(STEPS["max and min"], 40), "bomb.yaml")
    for i, text in enumerate(_shapes()):
        yield check("shapes of YAML", f"{i}", text)
    for i, text in enumerate(EQUATIONS):
        definition = f'  d1: {{is: "{text}"}}'
        yield check("equations", f"{i}", module(definition, "d1"), "bomb.yaml")
    for i, law in enumerate(LAWS):
        yield check("equations", f"law {i}", FAULT.format(law=law), "fault.yaml")


def _shapes() -> Iterator[Content]:
    joined = "[A -> C, B -> C]"
    yield "a: " + "[" * 5000 + "]" * 5000
    yield "[" * 100_000
    yield "\n".join(" " * i + "a:" for i in range(500))
    yield "fluid: a\n".encode("utf-16")
    yield "a: " + "{a: " * 3000 + "}" * 3000
    yield "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n"
    yield "plant: !!python/object/apply:os.system [touch ../outside/owned]\n"
    yield "plant: p\n---\nplant: q\n"
    yield plant(more="x: " + "9" * 5000)
    yield plant(more="x: 1e999")
    yield plant(more="\n".join(f"k{i}: 1" for i in range(10_000)))
    yield plant(more="k: 1\n" * 10_000)
    yield plant(more=f"{'k' * 100_000}: 1")
    yield plant(more=f"calibration: [{', '.join(['k.yaml'] * 20_000)}]")
    yield plant(more=f"calibration: [{', '.join(f'k{i}.yaml' for i in range(20_000))}]")
    yield plant().replace(joined, f"[{', '.join(['A -> C'] * 5000)}]")
    yield "plant: " + " " * 200_000 + "p\n"
    yield '"' * 50_000
    yield "plant: [p]\n"
    yield ""
    yield "plant: p\0\n"
    yield plant(more="columns: ../../../../etc/passwd")
    yield plant(more="kb: /proc")
    yield plant(more="calibration: [plant.yaml]")
    yield plant(more="adjacency: /dev/null").replace(f"connections: {joined}\n", "")


EQUATIONS = [
    "__import__('os').system('touch ../outside/owned')", "dp.__class__", "9**9**9**9",
    "((dp**8)**8)**8", "(" * 200 + "dp" + ")" * 200, "abs(" * 40 + "dp" + ")" * 40,
    "dp + " * 400 + "dp", "-" * 500 + "dp", "dp/0", "dp/(q - q)", "dp*1e400", "dp*1j",
    "lambda x: x", "'a'*10**9", "dp < 1", "(x := dp)", "d\u1e57",
    "dp/(dp + dp/(dp + dp/(dp + dp/(dp + dp/(dp + dp/(dp + dp))))))",
]  # fmt: skip
FAULT = """fault: f
title: t
acts_on: flow
law: "{law}"
degree: {{range: [0, 1], meaning: m}}
tolerance: 0.1
status: M
text: t
action: a
source: s
"""
LAWS = [
    "(1 - x)*g**8", "abs(" * 25 + "(1 - x)*g" + ")" * 25,
    " + ".join(["((g + 1)**4*(x + 1)**4)**2"] * 20), "g**9**9", "0*g*x",
]  # fmt: skip
