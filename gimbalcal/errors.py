"""The one exception that a user is meant to read."""


class InputError(ValueError):
    """Something given to the program cannot be used as it is.

    The message is one sentence: what is wrong, where (file, line or row, column), and what to write instead.
    The command line prints it and ends with status 2.
    """
