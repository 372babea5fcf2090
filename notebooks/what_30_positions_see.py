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
# # What 30 positions show
#
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md in this folder.*
#
# A unit that is turned in place navigates, and its true velocity is known: zero. Which errors of its six sensors does a
# sequence of turns show, and when? Covariances answer this before anything is recorded.

# %%
import matplotlib.pyplot as plt
import numpy as np

from gimbalcal.design.turning_observability import observe_turning
from gimbalcal.schedule import ROTATIONS
from gimbalcal.schedule.commands import contradictions, direction
from gimbalcal.schedule.trajectory import trajectory
from gimbalcal.units import from_si

# %% [markdown]
# Wei et al. (2022) print 15 turns, the axis of the unit and its direction; the other 15 are the same and reversed.
# Everything else follows, and each printed row is checked against the rows above it.

# %%
wei = ROTATIONS["wei2022-30"]
for k, C in enumerate(wei.attitudes()[:6]):
    turn = f"{wei.moves[k].axis} {np.rad2deg(wei.moves[k].angle):+.0f} deg" if k < 5 else "..."
    print(f"stop {k}: x {direction(C[:, 0]):5s} y {direction(C[:, 1]):5s} z {direction(C[:, 2]):5s}  then {turn}")
print(len(contradictions(wei)), "rows contradict;", f"{trajectory(wei).duration:.0f} s at 10 deg/s and stops of 100 s")

# %% [markdown]
# Six errors in thirty positions. Nothing is known of a gyroscope's scale factor until its axis has turned, and then
# much at once; biases improve slowly, with the square root of time or worse.

# %%
seen = observe_turning(wei, latitude=34.2, state_list="30")
print(seen.in_words)

fig, panels = plt.subplots(2, 3, figsize=(11, 5), sharex=True, layout="constrained")
names = ("gyro_bias", "gyro_scale_factor", "gyro_misalignment", "bias", "scale_factor", "misalignment")
for panel, name in zip(panels.flat, names, strict=True):
    mine = [curve for curve in seen.curves if curve.parameter.startswith(name + ":")]
    for curve in mine:
        panel.semilogy(seen.time / 60, from_si(curve.sigma, curve.unit), label=curve.parameter.split(":")[1])
    panel.set_title(f"{name} [{mine[0].unit}]")
    panel.legend(ncols=3, fontsize=7)
for panel in panels[-1]:
    panel.set_xlabel("minutes")
plt.show()

# %% [markdown]
# The paper's Table 2 states by which factor each state is known better than before, sqrt(P0 / Pk), without P0 or noise.
# For the gyroscopes' biases the printed values are ours times one number, within a percent; the last row of the table
# repeats the first row.

# %%
for row in seen.published["rows"]:
    print(
        f"{row['parameter']:22s} printed {row['printed']:7.2f}   here {row['degree']:7.0f}   ratio {row['ratio']:.3f}"
    )

# %% [markdown]
# The 51 states of Cai et al. (2016), at the same noise and in equal time: their 18 turns, Wei's 30, and 63 that a
# search on the covariance found for the same table. Largest sigma of each group, relative to the better of the two
# papers.

# %%
schedules = ("cai2016-18", "wei2022-30", "turns-63")
sigma = {}
for name in schedules:
    curves = observe_turning(name, 34.2, "51").curves
    for c in curves:
        own = " (own axis)" if c.parameter in ("gyro_g_sensitivity_rate:" + a for a in ("xx", "yy", "zz")) else ""
        group = c.parameter.split(":")[0] + own
        sigma.setdefault(group, dict.fromkeys(schedules, 0.0))
        sigma[group][name] = max(sigma[group][name], float(from_si(c.sigma[-1], c.unit)))
print(f"{'':36s}" + "".join(f"{name:>12s}" for name in schedules))
for group, values in sigma.items():
    print(f"{group:36s}" + "".join(f"{values[name]:12.4g}" for name in schedules))
