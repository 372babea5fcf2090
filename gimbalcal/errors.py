"""The one exception that a user is meant to read, and how a sentence counts and lists things."""

from __future__ import annotations

from collections.abc import Sequence


class InputError(ValueError):
    """Something given to the program cannot be used as it is.

    The message is one sentence: what is wrong, where (file, line or row, column), and what to write instead.
    The command line prints it and ends with status 2.
    """


def number_of(n: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun.

    >>> number_of(1, "rest position"), number_of(7, "rest position"), number_of(2, "axis", "axes")
    ('1 rest position', '7 rest positions', '2 axes')
    """
    return f"{n} {noun if n == 1 else plural or noun + 's'}"


def list_of_alternatives(items: Sequence[str]) -> str:
    """Return items as a list of alternatives, "a, b or c".

    >>> list_of_alternatives(["a", "b", "c"])
    'a, b or c'
    """
    return " or ".join(filter(None, [", ".join(items[:-1]), *items[-1:]]))


def shortened_text(text: str, most: int = 60) -> str:
    """Return `text`, less its middle where it is long: a message shows what was written, not all of it."""
    return text if len(text) <= most else f"{text[: most // 2]}...{text[-most // 4 :]}"
