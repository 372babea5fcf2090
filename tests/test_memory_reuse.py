"""Memory that arrays free is used again by the arrays that follow, instead of being given back and cleared."""

import os
import subprocess
import sys

import pytest

ARRAYS = """
import resource, sys
import numpy as np
from gimbalcal.memory_reuse import reuse_freed_memory
if sys.argv[1] == "reuse":
    reuse_freed_memory()
for _ in range(100):
    sum(np.ones(100_000) for _ in range(5))
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""


@pytest.mark.skipif(sys.platform != "linux" or "glibc" not in os.confstr("CS_GNU_LIBC_VERSION"), reason="glibc alone")
def test_arrays_after_others_take_no_pages_from_the_system() -> None:
    faults = {
        how: int(subprocess.run([sys.executable, "-c", ARRAYS, how], capture_output=True, check=True).stdout)
        for how in ("reuse", "as it is")
    }
    assert faults["reuse"] < faults["as it is"] / 2


HUGE_PAGES = """
import sys
import gimbalcal.cli
from gimbalcal.memory_reuse import reuse_freed_memory
assert "numpy" not in sys.modules
reuse_freed_memory()
import numpy as np
print(np._core.multiarray._set_madvise_hugepage(True))
"""


@pytest.mark.parametrize("stated", [None, "0", "1"])
def test_a_command_asks_for_no_huge_pages_unless_the_user_does(stated: str | None) -> None:
    environment = {k: v for k, v in os.environ.items() if k != "NUMPY_MADVISE_HUGEPAGE"}
    environment |= {} if stated is None else {"NUMPY_MADVISE_HUGEPAGE": stated}
    said = subprocess.run([sys.executable, "-c", HUGE_PAGES], capture_output=True, check=True, env=environment).stdout
    assert said.split() == [b"True" if stated == "1" else b"False"]
