"""A recording: what was logged, in SI, with where it came from; and the folder that holds it.

    recording = read("my-rig/2026-11-18")          # every check of the format, one sentence if one fails
    means = dwell_means(recording)                 # one row per dwell
    write(means, "my-rig/2026-11-18-means")
    from_arrays(t, specific_force=f, units={"specific_force": "g"})    # the same checks without a file

The format is described in docs/recording-format.md. `polars` is imported when a file is opened, not before.
"""

from gimbalcal.recording.detection import with_rests_as_positions
from gimbalcal.recording.dwell import Dwell, block_means, dwell_means, dwells
from gimbalcal.recording.frames import from_arrays, from_frame
from gimbalcal.recording.joining import join
from gimbalcal.recording.reading import read
from gimbalcal.recording.record import COLOURED, SENSORS, Recording, Site, Source, when_recorded
from gimbalcal.recording.writing import write

__all__ = [
    "COLOURED",
    "SENSORS",
    "Dwell",
    "Recording",
    "Site",
    "Source",
    "block_means",
    "dwell_means",
    "dwells",
    "from_arrays",
    "from_frame",
    "join",
    "read",
    "when_recorded",
    "with_rests_as_positions",
    "write",
]
