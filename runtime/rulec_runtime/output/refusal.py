"""What is said to the user who gave something that cannot be used."""

from __future__ import annotations


class Refusal(Exception):
    """What was given cannot be used; the message says why and what to do.

    Every mistake of the user raises one, or `Misused`, or OSError where a file cannot be read or
    written. All else is a bug of this tool.
    """

    def for_terminal(self) -> str:
        """What a command says."""
        # Imported here: exceptions are defined in files that load nothing else.
        from rulec_runtime.output.terminal import one_line

        return one_line(f"rulec: {self}")


def to_install(extra: str, package: str = "rulec-runtime") -> str:
    """What to type to add an extra to a package that is installed; it needs no index for ours."""
    return f"pip install '{package}[{extra}]'"


class Misused(ValueError):
    """An argument makes no sense, whatever the files hold; the message says what to give."""
