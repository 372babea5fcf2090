"""A recording that was made in Python, completed as a file is when it is read: rests found, scatter measured."""

from __future__ import annotations

from dataclasses import replace

from gimbalcal.recording.detection import detect
from gimbalcal.recording.record import FORCE, RATE, Recording
from gimbalcal.recording.scatter import pooled


def completed(recording: Recording) -> Recording:
    """The recording with the positions that nobody numbered, and the scatter of its rows at rest.

    A multi-position recording without positions is searched for rests, as `read` does with a file; what a recording
    has already stays. Rows that are means say nothing of the samples, and a channel that never moves has no scatter.
    """
    if recording.kind.in_positions and recording.has(FORCE):
        recording = with_rests(recording)
    if recording.scatter or recording.kind.sighting or len(recording.time) == 0:
        return recording
    found = pooled(recording.time, recording.position, recording.channels, recording.weight)
    seen = {key: sigma for key, sigma in found.items() if sigma > 0}
    return replace(recording, scatter=seen) if seen else recording


def with_rests(recording: Recording) -> Recording:
    """The recording with its rests as positions, found where its sensors are quiet if nobody numbered them."""
    if recording.position is not None:
        return recording
    forces, rates = ({a: recording.channels[q, a] for a in recording.axes(q)} for q in (FORCE, RATE))
    return replace(recording, position=detect(recording.time, forces or rates, rates, recording.counted(RATE)))
