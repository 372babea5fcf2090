"""The unit of a shipped scenario with linear errors and what is asked for, in fewer rows, which take the time."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import gimbalcal.simulate
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording
from gimbalcal.simulate import simulate

SCENARIOS = Path(gimbalcal.simulate.__file__).parents[1] / "scenarios"
PLAIN = ("bias", "scale_factor", "misalignment", "gyro_bias", "gyro_scale_factor", "gyro_misalignment")


def scenario(name: str = "turned-unit", holds: int = 24, **effects: Any) -> dict[str, Any]:
    """A scenario of rests and turns: so many holds of 6 s at 20 Hz, or revolutions at 10 Hz."""
    content = tomllib.loads((SCENARIOS / f"{name}.toml").read_text())
    content["truth"] = {k: v for k, v in content["truth"].items() if k in PLAIN} | effects
    content["schedule"] |= {"rate": {"value": 10.0, "unit": "Hz"}}
    if name == "turned-unit":
        content["schedule"] |= {"dwell": {"value": 6.0, "unit": "s"}, "rate": {"value": 20.0, "unit": "Hz"}}
        content["schedule"]["holds"] = content["schedule"]["holds"][:holds]
    return content


def gimballed(name: str = "turned-unit", **effects: Any) -> Recording:
    """The unit on its table."""
    return simulate(scenario(name, **effects), seed=5)[0]


def by_hand(**effects: Any) -> Recording:
    """The unit of which no angle and no noise is known, warming by 25 degC."""
    warm = {"temperature": {"shape": "ramp", "mean": 10.0, "rate": 360.0}}
    made, _ = simulate({**scenario(**effects), "environment": warm}, seed=5)
    kept = {k: v for k, v in made.channels.items() if k[0] != "gimbal_angle"}
    return replace(made, platform=BENCH, channels=kept, noise={})
