"""Commands to a platform: holds in order, the published schedules, and their files."""

from gimbalcal.schedule.commands import Hold, Move, RotationSchedule, Schedule
from gimbalcal.schedule.published import (
    EIGHTEEN_ANGLES,
    EIGHTEEN_POSITIONS,
    FACE_POSITIONS,
    FIFTEEN_ANGLES,
    FIFTEEN_POSITIONS,
    ROTATIONS,
    SCHEDULES,
)

__all__ = [
    "EIGHTEEN_ANGLES",
    "EIGHTEEN_POSITIONS",
    "FACE_POSITIONS",
    "FIFTEEN_ANGLES",
    "FIFTEEN_POSITIONS",
    "ROTATIONS",
    "SCHEDULES",
    "Hold",
    "Move",
    "RotationSchedule",
    "Schedule",
]
