"""Find tables in a tree of named arrays: arrays of one length in one group, one of them a time."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rulec_runtime.recordings.arrays import array_sheet
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.titles import is_time


@dataclass(frozen=True)
class Leaf:
    """An array of a file: its number of rows, a function that reads its values, and its unit if the
    file gives it."""

    rows: int
    load: Callable[[], Any]
    unit: str = ""


@dataclass(frozen=True)
class Group:
    """Arrays side by side under a name."""

    name: str
    leaves: Mapping[str, Leaf]


def tables(groups: Sequence[Group], times: Collection[str]) -> list[Sheet]:
    """A table for each time column of a group, with the arrays of its length; one for each length
    if a group has none.

    A group without a time belongs to the nearest enclosing group that has one: array `dp` of group
    `A` is `A.dp` there.
    """
    timed = {g.name for g in groups if _timed(g.leaves, times)}
    whole: dict[str, dict[str, Leaf]] = {g.name: {} for g in groups}
    for group in groups:
        owner = group.name
        while owner and owner not in timed:
            owner = owner.rpartition("/")[0]
        owner = owner if owner in timed else group.name
        below = group.name[len(owner) :].strip("/").replace("/", ".")
        for name, leaf in group.leaves.items():
            whole[owner][f"{below}.{name}" if below else name] = leaf
    return [
        sheet for group in groups for sheet in _tables(Group(group.name, whole[group.name]), times)
    ]


def _timed(names: Iterable[str], times: Collection[str]) -> bool:
    """Whether one of the arrays holds times."""
    return any(is_time(name, times) for name in names)


def _tables(group: Group, times: Collection[str]) -> Iterator[Sheet]:
    by_length: dict[int, list[str]] = {}
    for name, leaf in group.leaves.items():
        if leaf.rows > 1:
            by_length.setdefault(leaf.rows, []).append(name)
    several = sum(_timed(names, times) for names in by_length.values()) > 1
    for rows, names in by_length.items():
        name = f"{group.name}/{rows} rows".strip("/") if several else group.name
        leaves = [group.leaves[n] for n in names]

        def pieces(indexes: Sequence[int], own: Sequence[Leaf] = leaves) -> Iterator[list[Any]]:
            yield [own[i].load() for i in indexes]

        yield array_sheet(name, names, [leaf.unit for leaf in leaves], rows, pieces)
