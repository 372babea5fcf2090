"""The command line in this process, and what it makes of the untouched recording."""

from collections.abc import Callable

import pytest

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(command, capsys):
    """The command line in this process: status, stdout and stderr."""

    def go(*arguments):
        status = command(*arguments)
        shown = capsys.readouterr()
        return status, shown.out, shown.err

    return go
