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
# # Your own data
#
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md in this folder.*
#
# Arrays or a data frame in; checks, calibration, diagnosis; arrays out. Everything passes the same checks, and gets the
# same sigmas, as a recording in files. Replace the next cell by your own log.

# %%
import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import gimbalcal
from gimbalcal.simulate import simulate


def my_log():
    """Time [s], force [g], rate [deg/s], temperature [degC] of a unit turned by hand through 24 rests of 8 s."""
    turns = np.random.default_rng(5).integers(-11, 12, (24, 3)) * 15.0
    recording, _ = simulate({
        "format": 1, "kind": "multi-position", "gyroscopes": True, "seed": 2, "title": "a unit in the hand",
        "site": {"latitude": {"value": 48.1, "unit": "deg"}, "height": {"value": 520.0, "unit": "m"}},
        "platform": {"name": "three-axis-table"},
        "schedule": {
            "dwell": {"value": 8.0, "unit": "s"}, "slew_rate": {"value": 90.0, "unit": "deg/s"},
            "rate": {"value": 50.0, "unit": "Hz"}, "settle": {"value": 0.5, "unit": "s"},
            "holds": [dict(zip(("inner", "middle", "outer"), map(float, a), strict=True)) for a in turns],
        },
        "noise": {"accelerometer": {"value": 300.0, "unit": "ug"}, "gyroscope": {"value": 100.0, "unit": "deg/h"}},
        "environment": {"temperature": {"shape": "ramp", "mean": 25.0, "rate": 90.0}},
        "truth": {
            "bias": {"x": 3000, "y": -2000, "z": 5000}, "scale_factor": {"x": 4000, "y": -2500, "z": 1500},
            "misalignment": {"yz": 900, "zy": -500, "zx": 700}, "gyro_bias": {"x": 900, "y": -400, "z": 1200},
            "gyro_scale_factor": {"x": 5000, "y": -3000, "z": 2000}, "bias_temperature": {"z": 700},
        },
    })  # fmt: skip
    force, rate = recording.triad("specific_force"), recording.triad("angular_rate")
    return recording.time, force / 9.80665, np.degrees(rate), recording.channels["temperature", ""]


t, f, w, warm = my_log()
print(f"{len(t)} rows in {t[-1]:.0f} s; the first: {f[0].round(4)} g, {w[0].round(3)} deg/s, {warm[0]:.2f} degC")

# %% [markdown]
# ## Input
#
# Units are stated once. The site gives gravity to some 30 ppm (latitude and height); without it gravity is uncertain by
# 1530 ppm, which is part of the sigma of every scale factor.

# %%
units = {"specific_force": "g", "angular_rate": "deg/s", "temperature": "degC"}
where = {"latitude": (48.1, "deg"), "height": (520.0, "m")}
recording = gimbalcal.from_arrays(t, specific_force=f, angular_rate=w, temperature=warm, units=units, site=where)

# %% [markdown]
# A data frame is accepted as well: polars, pandas, or a dictionary of columns. Each column states what it holds.

# %%
frame = pl.DataFrame({"t": t, **dict(zip(["ax", "ay", "az", "gx", "gy", "gz"], [*f.T, *w.T], strict=True)), "T": warm})
columns = {"t": "time [s]", "T": "temperature [degC]"}
columns |= {f"a{axis}": f"specific_force {axis} [g]" for axis in "xyz"}
columns |= {f"g{axis}": f"angular_rate {axis} [deg/s]" for axis in "xyz"}
same = gimbalcal.from_frame(frame, columns, site=where)
assert all(np.array_equal(same.channels[key], recording.channels[key]) for key in recording.channels)
print(frame.head(3))

# %% [markdown]
# ## Checks
#
# Input that cannot be right is refused in one sentence: a force declared as m/s^2 that is in g, two accelerometers
# exchanged, a clock that runs backwards in one row.

# %%
of_both = {"specific_force": "g", "angular_rate": "deg/s"}
swapped = t.copy()
swapped[[700, 701]] = swapped[[701, 700]]
for time, force, unit in ((t, f, "m/s^2"), (t, f[:, [1, 0, 2]], "g"), (swapped, f, "g")):
    try:
        gimbalcal.calibrate(gimbalcal.from_arrays(
            time, specific_force=force, angular_rate=w, units=of_both | {"specific_force": unit}, site=where
        ))  # fmt: skip
    except gimbalcal.InputError as refusal:
        print("refused:", refusal, "\n")

# %% [markdown]
# ## Calibration
#
# No attitude is known: at rest the norm of the force is gravity, and the turns carry gravity from one dwell to the
# next. The dwells are detected, and the noise is estimated.

# %%
calibration = gimbalcal.calibrate(recording)
print(calibration)
print(calibration.outcome)

# %% [markdown]
# ## Diagnosis
#
# Something is missing: positions scatter 77 times as much as their samples. What is it?

# %%
found = gimbalcal.diagnose(recording)
print(found)
found.plot()

# %% [markdown]
# The bias of z depends on the temperature. *Or on the time*: this log was made while the unit warmed up evenly, so that
# the two are equivalent here, and the answer says so. Either corrects these data; a log at another temperature would
# distinguish them. The effect is added to the model:

# %%
calibration = gimbalcal.calibrate(recording, more=["bias_temperature:z"])
print(calibration.outcome or "explained")
table = calibration.to_frame()
print(table.select("name", "axis", "value", "sigma", "unit"))
calibration.plot()

# %% [markdown]
# ## What is unobservable
#
# `unobservable` lists what these data do not determine, with the reason. A rotation of the whole triad is unobservable
# for a unit in the hand; terms that were tried and not supported are listed with the reason.

# %%
for u in calibration.unobservable:
    print("-", u["why"])

# %% [markdown]
# The estimates are correlated: the sigma of a quantity that is computed from several of them requires the covariance.

# %%
labels = [p.label for p in calibration.parameters]
D = np.sqrt(np.diag(calibration.covariance))
correlation = calibration.covariance / np.outer(D, D)
k = 10
fig, ax = plt.subplots(figsize=(5.5, 4.5), layout="constrained")
drawn = ax.imshow(correlation[:k, :k], vmin=-1, vmax=1, cmap="RdBu_r")
ax.set_xticks(range(k), labels[:k], rotation=90)
ax.set_yticks(range(k), labels[:k])
fig.colorbar(drawn, label="correlation")
plt.show()

# %% [markdown]
# ## Output
#
# Corrected arrays, in the units of the input. The norm of the force at rest should now be gravity.

# %%
readings = {"time": t, "specific_force": f, "angular_rate": w, "temperature": warm}
true = calibration.apply(readings, units=units)
still = np.linalg.norm(w - np.median(w, axis=0), axis=1) < 1.0
g = recording.site.gravity / 9.80665
for name, force in (("as read", f), ("corrected", true["specific_force"])):
    off = (np.linalg.norm(force[still], axis=1) - g) * 1e3
    print(f"{name:10s} norm of the force at rest less gravity: {off.mean():+.3f} mg, scatter {off.std():.3f} mg")
