"""Read a MATLAB file in a process of its own, with limits on memory and time: run as FROM.mat INTO.npz BYTES.

A damaged file can end the process that reads it (SciPy's reader is compiled and trusts lengths), or ask for all memory.
Fields of structures have dotted names; what is no array of numbers or text is left out.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

NOT_READABLE = 7  # exit status
MAX_CPU_S = 600


def matlab_variables(path: Path) -> dict[str, Any]:
    """Return the variables of a MATLAB file up to v7 as arrays by name. Raises InputError."""
    import numpy as np

    from gimbalcal.errors import InputError
    from gimbalcal.recording.memory_limit import memory_limit

    with tempfile.TemporaryDirectory(prefix="gimbalcal-") as folder:
        into = Path(folder) / "variables.npz"
        command = [sys.executable, "-P", __file__, str(path.absolute()), str(into), str(memory_limit())]
        ended = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)  # noqa: S603
        if ended.returncode or not into.is_file():
            raise InputError(
                f"{path} is not a MATLAB file of version 5 to 7, or it is cut short or damaged; save it again (text "
                "files that are only called .mat go through `gimbalcal import imu-tk` or `csv`)"
            )
        with np.load(into) as archive:
            return {name: np.asarray(archive[name]) for name in archive.files}


def _flat_values(name: str, value: Any) -> dict[str, Any]:
    import numpy as np

    fields = getattr(value, "_fieldnames", None)
    if fields is not None:
        return {k: v for field in fields for k, v in _flat_values(f"{name}.{field}", getattr(value, field)).items()}
    array = np.asarray(value)
    return {name: array} if array.dtype.kind in "biufcU" else {}


def _main() -> None:
    import resource

    import numpy as np
    import scipy.io

    source, into, max_bytes = sys.argv[1], sys.argv[2], int(sys.argv[3])
    for limit, wanted in ((resource.RLIMIT_AS, max_bytes), (resource.RLIMIT_CPU, MAX_CPU_S), (resource.RLIMIT_CORE, 0)):
        allowed = resource.getrlimit(limit)[1]  # a limit of the caller's cannot be raised
        value = wanted if allowed == resource.RLIM_INFINITY else min(wanted, allowed)
        resource.setrlimit(limit, (value, value))
    try:
        variables = scipy.io.loadmat(source, struct_as_record=False, squeeze_me=True)
        arrays: dict[str, Any] = {}
        for name, value in variables.items():
            arrays |= {} if name.startswith("__") else _flat_values(name, value)
    except Exception:  # noqa: BLE001  whatever it is, the file is none that can be read
        sys.exit(NOT_READABLE)
    with open(into, "wb") as file:  # noqa: PTH123  savez would add an ending to a name
        np.savez(file, **arrays)


if __name__ == "__main__":
    _main()
