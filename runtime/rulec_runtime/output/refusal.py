"""Mistakes of the user, as exceptions."""


class Refusal(Exception):
    """An input cannot be used; the message says why and what to do.

    Every mistake of the user raises this, `Misused`, or OSError if a file cannot be read or
    written. Any other exception is a bug of this tool.
    """

    def for_terminal(self) -> str:
        """The message of a command."""
        # Imported here: files that define exceptions load nothing else.
        from rulec_runtime.output.terminal import one_line

        return one_line(f"rulec: {self}")


def to_install(extra: str, package: str = "rulec-runtime") -> str:
    """The command that adds an extra to an installed package; ours needs no package index."""
    return f"pip install '{package}[{extra}]'"


class Misused(ValueError):
    """An argument makes no sense, whatever the files contain; the message says what to give."""
