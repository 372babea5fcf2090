# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # 51 states on one screen
#
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md in this folder.*
#
# A unit with every error of Cai et al. (2016) is turned through their 18 turns and calibrates itself: it navigates, and
# its true velocity is zero. 42 parameters and nine navigation errors are estimated together; table angles are not used.
# The truth is known from the simulator. (An hour at 10 Hz here; the paper uses 100 Hz.)

# %%
import matplotlib.pyplot as plt
import numpy as np

import gimbalcal
from gimbalcal.effects import values
from gimbalcal.simulate.simulation import simulate
from gimbalcal.units import from_si

ppm, arcsec = {"x": 300.0, "y": -300.0, "z": 300.0}, {"xy": 180.0, "xz": -90.0, "yz": 60.0, "yx": -180.0, "zx": 90.0}
recording, truth = simulate({
    "format": 1, "kind": "rotation", "title": "18 turns, 51 states", "seed": 3,
    "site": {"latitude": {"value": 34.2, "unit": "deg"}},
    "schedule": {"name": "cai2016-18", "rate": {"value": 10.0, "unit": "Hz"}},
    "noise": {"accelerometer": {"value": 16.0, "unit": "ug"}, "gyroscope": {"value": 0.4, "unit": "deg/h"},
              "velocity": {"value": 0.01, "unit": "mm/s"}},
    "truth": {
        "scale_factor": ppm, "gyro_scale_factor": {"x": -300.0, "y": 200.0, "z": 100.0}, "misalignment": arcsec,
        "gyro_misalignment": {"yz": 120.0, "zy": -60.0, "zx": 30.0}, "bias": {"x": 200.0, "y": -100.0, "z": 50.0},
        "gyro_bias": {"x": 0.05, "y": -0.1, "z": 0.02}, "quadratic_nonlinearity": {"x": 60.0, "y": -40.0, "z": 20.0},
        "gyro_g_sensitivity_rate": {"xy": 0.1, "yz": -0.2, "zz": 0.3}, "cross_coupling": {"xy": 40.0, "zx": -30.0},
        "accelerometer_lever_arm": {"xx": 10.0, "yy": -20.0, "zz": 5.0},
    },
})  # fmt: skip
print(f"{len(recording.time)} rows, {recording.time[-1] / 3600:.2f} h")

# %% [markdown]
# First the 30 states of a usual calibration. They do not explain the innovations, and the result says so.

# %%
print(gimbalcal.calibrate(recording, states="30").outcome)

# %% [markdown]
# Then all 51, estimates and truth.

# %%
found = gimbalcal.calibrate(recording, states="51")
print(found.outcome or "explained", "-", f"NIS {found.residual.navigation['nis']['ratio']:.3f}")
went_in = values(truth, found.parameters)
sigmas_off = (found.values - went_in) / found.sigmas
print(f"errors in stated sigmas: rms {np.sqrt(np.mean(sigmas_off**2)):.2f}, largest {np.abs(sigmas_off).max():.2f}")

# %% [markdown]
# On one screen: each panel is a kind of error, with its three to six or nine axes. Crosses are the truth, bars the
# estimates with three sigmas; next to it, the decrease of sigma with each turn. Where bars are invisible, the sigma is
# smaller than the dot.

# %%
kinds = list(dict.fromkeys(p.effect for p in found.parameters))
hours = np.array(found.residual.navigation["time_s"]) / 3600
fig, panels = plt.subplots(len(kinds) // 2, 4, figsize=(14, 8), layout="constrained")
for (left, right), kind in zip(panels.reshape(-1, 2), kinds, strict=True):
    mine = [i for i, p in enumerate(found.parameters) if p.effect == kind]
    unit = found.parameters[mine[0]].unit
    x = np.arange(len(mine))
    left.errorbar(x, from_si(found.values[mine], unit), 3 * from_si(found.sigmas[mine], unit), fmt="o", ms=4)
    left.plot(x, from_si(went_in[mine], unit), "kx")
    left.set_xticks(x, [found.parameters[i].axis for i in mine])
    left.set_title(f"{kind.replace('_', ' ')} [{unit}]", loc="left", fontsize=9)
    for i in mine:
        right.semilogy(hours, found.residual.navigation["sigma"][found.parameters[i].label], lw=1)
    right.set_title("sigma against time [h]", loc="left", fontsize=9)
plt.show()

# %% [markdown]
# Sigmas that decrease in steps are determined by a turn; those that decrease slowly depend on the Earth's rate. Own-
# axis g-sensitivities (the upper three lines of their panel) act only while the axis is vertical, where they turn the
# heading.
