"""Complete a recording that was made in Python as a file is when it is read: rests detected, scatter measured."""

from __future__ import annotations

from dataclasses import replace

from gimbalcal.recording.detection import detect
from gimbalcal.recording.record import FORCE, RATE, Recording
from gimbalcal.recording.scatter import pooled


def completed(recording: Recording) -> Recording:
    """Return the recording with its rests as positions, and the scatter of its rows at rest.

    A multi-position recording without positions is searched for rests, as `read` does with a file; what a recording
    has already stays. Rows that are means say nothing of the samples, and a channel that never moves has no scatter.
    """
    if recording.kind.in_positions and recording.has(FORCE):
        recording = with_rests(recording)
    if recording.scatter or recording.kind.sighting or len(recording.time) == 0:
        return recording
    sigmas = pooled(recording.time, recording.position, recording.channels, recording.weight)
    scatter = {key: sigma for key, sigma in sigmas.items() if sigma > 0}
    return replace(recording, scatter=scatter) if scatter else recording


def with_rests(recording: Recording) -> Recording:
    """Return the recording with its rests as positions, detected where its sensors are quiet if none are numbered."""
    if recording.position is not None:
        return recording
    forces, rates = ({a: recording.channels[q, a] for a in recording.axes(q)} for q in (FORCE, RATE))
    return replace(recording, position=detect(recording.time, forces or rates, rates, recording.counted(RATE)))
