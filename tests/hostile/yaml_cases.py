"""Hostile knowledge and plant files."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from tests.hostile.case import Case
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


def check(family: str, name: str, text: str, file: str = "plant.yaml") -> Case:
    return Case(family, name, ("check", file), {file: text})


def cases() -> Iterator[Case]:
    for name, text in ESCAPED.items():
        family = "control characters in YAML"
        yield check(family, f"{name} in a plant's title", plant(title=text))
        yield check(family, f"{name} in a module's title", plant(module=text))
        yield check(family, f"{name} as a key", plant(more=f'"{text}": 1'))
        yield check(family, f"{name} as a file", plant(more=f'columns: "{text}"'))
        yield check(family, f"{name} in a source", module(source=text), "bomb.yaml")
        yield check(family, f"{name} as a unit", module().replace("ml/rev", f'"{text}"'), "b.yaml")
    for i, text in enumerate(MARKUP):
        quoted = text.replace("\\", "\\\\")
        files = {"p/plant.yaml": plant(title=quoted, module=quoted)}
        yield Case("markup", f"{i} in a title, compiled", ("compile", "p"), files)
        yield Case("markup", f"{i} in a title, shown", ("matrix", "p"), files)
        yield Case(
            "markup",
            f"{i} as a file name",
            ("compile", "p", "-o", f"x{i}{text.replace('/', '')}"),
            files,
        )
        yield Case("markup", f"{i} as a plant", ("check", text))
    for name, step in STEPS.items():
        for count in (10, 40, 300):
            yield check("definition bombs", f"{name} {count}", bomb(step, count), "bomb.yaml")
    yield from _structures()
    yield from _equations()


def _structures() -> Iterator[Case]:
    family = "shapes of YAML"
    shapes = {
        "deep list": "a: " + "[" * 5000 + "]" * 5000,
        "deep group": "a: " + "{a: " * 3000 + "}" * 3000,
        "anchors": "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n",
        "tag": "plant: !!python/object/apply:os.system [touch ../outside/owned]\n",
        "two documents": "plant: p\n---\nplant: q\n",
        "number of 5000 digits": plant(more="x: " + "9" * 5000),
        "infinite": plant(more="x: 1e999"),
        "10000 keys": plant(more="\n".join(f"k{i}: 1" for i in range(10_000))),
        "one key 10000 times": plant(more="k: 1\n" * 10_000),
        "a name of 100000 letters": plant(more=f"{'k' * 100_000}: 1"),
        "a calibration 20000 times": plant(more=f"calibration: [{', '.join(['k.yaml'] * 20_000)}]"),
        "20000 calibrations": plant(
            more=f"calibration: [{', '.join(f'k{i}.yaml' for i in range(20_000))}]"
        ),
        "5000 connections": plant(more="").replace(
            "[A -> C, B -> C]", f"[{', '.join(['A -> C'] * 5000)}]"
        ),
        "blanks": "plant: " + " " * 200_000 + "p\n",
        "quotes": '"' * 50_000,
        "a list as plant": "plant: [p]\n",
        "nothing": "",
        "null byte": "plant: p\0\n",
        "columns elsewhere": plant(more="columns: ../../../../etc/passwd"),
        "knowledge base elsewhere": plant(more="kb: /proc"),
        "itself as calibration": plant(more="calibration: [plant.yaml]"),
        "adjacency from a device": plant(more="adjacency: /dev/null").replace(
            "connections: [A -> C, B -> C]\n", ""
        ),
    }
    for name, text in shapes.items():
        yield check(family, name, text)


def _equations() -> Iterator[Case]:
    family = "equations"
    texts = {
        "call": "__import__('os').system('touch ../outside/owned')",
        "attribute": "dp.__class__",
        "tower": "9**9**9**9",
        "nested powers": "((dp**8)**8)**8",
        "deep": "(" * 200 + "dp" + ")" * 200,
        "deep roots": "abs(" * 40 + "dp" + ")" * 40,
        "long": "dp + " * 400 + "dp",
        "minus signs": "-" * 500 + "dp",
        "divides by zero": "dp/0",
        "hidden zero": "dp/(q - q)",
        "huge": "dp*1e400",
        "imaginary": "dp*1j",
        "lambda": "lambda x: x",
        "string": "'a'*10**9",
        "comparison": "dp < 1",
        "walrus": "(x := dp)",
        "unicode": "d\u1e57",
        "fraction of fractions": "dp/(dp + dp/(dp + dp/(dp + dp/(dp + dp/(dp + dp/(dp + dp))))))",
    }
    for name, text in texts.items():
        definition = f'  d1: {{is: "{text}"}}'
        yield check(family, name, module(definition, "d1"), "bomb.yaml")
    fault = """fault: f
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
    for name, law in {
        "power": "(1 - x)*g**8",
        "deep": "abs(" * 25 + "(1 - x)*g" + ")" * 25,
        "sum of powers": " + ".join(["((g + 1)**4*(x + 1)**4)**2"] * 20),
        "tower": "g**9**9",
        "nothing": "0*g*x",
    }.items():
        yield check("equations", f"law of a fault: {name}", fault.format(law=law), "fault.yaml")
