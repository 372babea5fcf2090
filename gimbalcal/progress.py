"""Progress of long work: a function that takes one sentence at a time."""

from collections.abc import Callable

Progress = Callable[[str], None]


def no_progress(_: str) -> None:
    """Report nothing."""
