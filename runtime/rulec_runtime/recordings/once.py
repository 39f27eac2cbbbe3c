"""What several passes ask of the same recording is worked out once, and kept with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording

Found = TypeVar("Found")


def once(
    function: Callable[[Recording, Ruleset], Found],
) -> Callable[[Recording, Ruleset], Found]:
    """The same function, called once for a recording and a ruleset."""

    @wraps(function)
    def asked(recording: Recording, ruleset: Ruleset) -> Found:
        known = recording.kept.get(asked)
        if known is None or known[0] is not ruleset:
            known = recording.kept[asked] = ruleset, function(recording, ruleset)
        found: Found = known[1]
        return found

    return asked
