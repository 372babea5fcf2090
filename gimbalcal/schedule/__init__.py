"""Commands to a platform: holds in order, the published schedules, and their files."""

from gimbalcal.schedule.published import (
    EIGHTEEN_ANGLES,
    EIGHTEEN_POSITIONS,
    FACE_POSITIONS,
    FIFTEEN_ANGLES,
    FIFTEEN_POSITIONS,
    SCHEDULES,
)
from gimbalcal.schedule.rotation import Move, RotationSchedule
from gimbalcal.schedule.rotations import ROTATIONS
from gimbalcal.schedule.schedule import Hold, Schedule

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
