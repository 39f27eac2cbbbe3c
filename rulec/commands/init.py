"""`rulec init`: commented skeletons of a plant, a module type, a fault, an effect, a package."""

import argparse
import os
import re
from collections.abc import Iterator
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text

from rulec.commands.schema import line, schema_near, schemas, target
from rulec.knowledge.layers import KB, shipped
from rulec.language.read_yaml import parse_document
from rulec.language.schema import kind_of

FOLDER = Path(__file__).resolve().parent.parent / "skeletons"

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,60}")


def run(options: argparse.Namespace) -> int:
    """Write a skeleton into a folder; no file is ever replaced."""
    own = options.name if options.kind in ("plant", "kb") else "."
    folder = Path(options.folder or own)
    files = dict(skeleton(options.kind, options.name, folder, options.like))
    for file in files:
        if os.path.lexists(file):
            raise Refusal(
                f"'{file}' already exists and was not overwritten; choose another name or folder"
            )
    out = console(options)
    for file, text in files.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, text)
    shown = [file for file in files if file.suffix != ".json"]
    for file in shown:
        out.print(styled("[green]✓[/] {}", file), soft_wrap=True)
    if len(shown) < len(files):
        out.print(styled("[dim]and schemas for completion and checking in an editor[/]"))
    out.print(styled("next: rulec check {}", folder), soft_wrap=True)
    return 0


def skeleton(
    kind: str, name: str, folder: Path, like: str | None = None
) -> Iterator[tuple[Path, str]]:
    """Files and texts of a skeleton, with the schemas if an editor would find none.

    With `like`, a plant begins as a copy of that shipped one. Raises `Refusal` if other files
    could not use the name, or if `like` is no shipped plant.
    """
    if not _NAME.fullmatch(name):
        hint = "a letter, then at most 60 letters, digits, _ and -"
        if os.path.basename(name) != name:
            hint += f"; the folder comes after it: rulec init {kind} {Path(name).name} {name}"
        raise Refusal(f"'{name[:70]}' is not a legal name: {hint}")
    package = re.sub(r"[^a-z0-9]", "_", name.lower())
    knowledge = {"plant": folder / KB, "kb": folder / package}.get(kind, folder)
    slots = {"NAME": name, "PACKAGE": package}
    texts = dict(_filled(kind, folder, slots))
    if like is not None:
        if kind != "plant":
            raise Refusal(f"--like names a plant to begin with; a {kind} has none")
        texts[folder / "plant.yaml"] = _like(like, name)
    if kind == "kb":
        texts |= _filled("module", knowledge, {**slots, "NAME": f"{name}-example"})
    kinds = {file: _kind(text) for file, text in texts.items() if file.suffix == ".yaml"}
    bare = False
    for file, one in kinds.items():
        near = schema_near(file, one)
        bare = bare or near is None
        to = target(file, knowledge if near is None else near.parent.parent, one)
        texts[file] = texts[file].replace("SCHEMA", to, 1)
    yield from texts.items()
    if bare:
        yield from schemas(knowledge)


def _filled(kind: str, folder: Path, slots: dict[str, str]) -> Iterator[tuple[Path, str]]:
    root = FOLDER / kind
    for file in sorted(part for part in root.rglob("*") if part.is_file()):
        inside, text = file.relative_to(root).as_posix(), file.read_text(encoding="utf-8")
        for slot, value in slots.items():
            inside, text = inside.replace(slot, value), text.replace(slot, value)
        # Python code ends in .txt, as it is no module of this package.
        yield folder / inside.removesuffix(".txt"), text


def _like(like: str, name: str) -> str:
    """The file of a shipped plant under another name. Those with a README need no other file."""
    readmes = sorted(shipped("plants").glob("*/README.md"))
    known = {file.parent.name: file.parent for file in readmes}
    if like not in known:
        raise Refusal(f"no plant '{like[:70]}' is shipped; take one of {', '.join(known)}")
    text = (known[like] / "plant.yaml").read_text(encoding="utf-8").partition("\n")[2]
    return line("SCHEMA") + "\n" + re.sub(r"(?m)^plant: .*$", f"plant: {name}", text, count=1)


def _kind(text: str) -> str:
    document, _ = parse_document("skeleton", text)
    assert document is not None
    kind = kind_of(document)
    assert kind is not None
    return kind
