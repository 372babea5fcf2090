"""Checks of a recording: whatever refuses it, questions it, or leaves rows out.

While rows are read: `unreadable` (the file), `dropouts` and `spikes` (rows that are left out), `stream_checks` (each
row and the clock), `column_checks` (each column as a whole) and `jitter` (time stamps). Before a recording is
calibrated: `table`, the checks of each kind of recording, in the order in which they are made. `input_errors` holds
what a person may have stated wrongly, as corrections that are tried one by one.
"""

import gimbalcal.recording  # noqa: F401  (the reader imports this package: it comes first, whichever is imported)
