"""Reads one MATLAB file into plain arrays: run as a program, FROM.mat INTO.npz BYTES, so that its crash is its own.

A damaged file can end the process that reads it (SciPy's reader is compiled and trusts lengths), or ask for all memory.
Structures come by dotted names; what is no array of numbers or text is left out.
"""

from __future__ import annotations

import resource
import sys
from typing import Any

REFUSED = 7  # exit status for a file that is none
SECONDS = 600


def flat(name: str, value: Any) -> dict[str, Any]:
    """Arrays by dotted name."""
    import numpy as np

    fields = getattr(value, "_fieldnames", None)
    if fields is not None:
        out: dict[str, Any] = {}
        for field in fields:
            out |= flat(f"{name}.{field}", getattr(value, field))
        return out
    array = np.asarray(value)
    return {} if array.dtype.kind not in "biufcU" else {name: array}


def main() -> None:
    """Read, flatten, write."""
    import numpy as np
    import scipy.io

    source, into, most = sys.argv[1], sys.argv[2], int(sys.argv[3])
    for what, wanted in ((resource.RLIMIT_AS, most), (resource.RLIMIT_CPU, SECONDS), (resource.RLIMIT_CORE, 0)):
        allowed = resource.getrlimit(what)[1]  # a limit of the caller's cannot be raised
        at = wanted if allowed == resource.RLIM_INFINITY else min(wanted, allowed)
        resource.setrlimit(what, (at, at))
    try:
        variables = scipy.io.loadmat(source, struct_as_record=False, squeeze_me=True)
        found: dict[str, Any] = {}
        for name, value in variables.items():
            found |= {} if name.startswith("__") else flat(name, value)
    except Exception:  # noqa: BLE001  whatever it is, the file is none that can be read
        sys.exit(REFUSED)
    with open(into, "wb") as file:  # noqa: PTH123  savez would add an ending to a name
        np.savez(file, **found)


if __name__ == "__main__":
    main()
