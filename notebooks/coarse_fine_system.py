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
# # From coarse to fine to system level
#
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md in this folder.*
#
# The three stages of Wu et al. (2018) on a recording with known truth: 18 positions of ten minutes, then 48 hours in
# which the platform is inertially stable while the Earth rotates. What does each stage add?

# %%
import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from gimbalcal.cli.demonstration import shipped
from gimbalcal.pipeline import load, three_stage
from gimbalcal.units import from_si, to_si

data = shipped()
device, run = load([data / "space_stable_18", data / "space_stable_static"])
alone = three_stage([device])
fused = three_stage([device, run])

# %% [markdown]
# The truth of the simulator and the estimates. The last column is the error in units of its stated sigma: most should
# lie within one, hardly any beyond two.

# %%
truth = {
    f"{p['name']}:{p['axis']}": to_si(p["value"], p["unit"])
    for p in json.loads((Path(data) / "space_stable_18" / "truth.json").read_text(encoding="utf-8"))["parameters"]
}


def table(calibration):
    """Print value, sigma and error of each parameter that the truth states."""
    for p, x, sigma in zip(calibration.parameters, calibration.values, calibration.sigmas, strict=True):
        if p.label in truth:
            value, s = from_si(x, p.unit), from_si(sigma, p.unit)
            print(f"{p.label:24s} {value:9.2f} +- {s:6.2f} {p.unit:8s} {(x - truth[p.label]) / sigma:+5.1f}")


table(alone)

# %%
table(fused)

# %% [markdown]
# The static run alone does not determine a bias: in the x channel it determines only bias minus sin(latitude) times a
# misalignment. The 18 positions determine the misalignments, so that together they determine both. For this reason the
# stages are combined as information, with their covariances, instead of one replacing the other.

# %%
labels = [p.label for p in alone.parameters]
gain = [
    alone.sigmas[labels.index(p.label)] / s
    for p, s in zip(fused.parameters, fused.sigmas, strict=True)
    if p.label in labels
]
names = [p.label for p in fused.parameters if p.label in labels]
fig, axes = plt.subplots(figsize=(8, 4))
axes.barh(names, gain, color="#0072B2")
axes.axvline(1, color="black", linewidth=0.8)
axes.invert_yaxis()
axes.set_xlabel("sigma of the 18 positions alone / sigma of both together")
plt.show()

# %% [markdown]
# The static run by the method of the paper: a Kalman filter of five states on the specific-force error, Eqs. (20)-(27),
# over means of the rows. One turn of the Earth separates the states; their bands are one sigma, and the lines are the
# closed form, which adds up the same information at once.

# %%
combined, filtered = (next(s for s in fused.stages if word in s.name) for word in ("combined", "Kalman"))
history = filtered.history
fig, axes = plt.subplots(5, 1, figsize=(8, 9), sharex=True, layout="constrained")
for i, (ax, name) in enumerate(zip(axes, filtered.labels, strict=True)):
    x, sigma = from_si(history.values[:, i], "urad"), from_si(history.sigmas[:, i], "urad")
    shown = sigma < 8 * sigma[-1]
    ax.fill_between(history.time[shown] / 3600, (x - sigma)[shown], (x + sigma)[shown], color="#0072B2", alpha=0.2)
    ax.plot(history.time[shown] / 3600, x[shown], color="#0072B2")
    ax.axhline(from_si(combined.value_of(name), "urad"), color="black", linewidth=0.8)
    ax.set_ylabel(f"{name} [urad]")
axes[-1].set_xlabel("time [h]")
plt.show()
print(filtered.in_words)

# %% [markdown]
# Combinations that neither determines are listed by name:

# %%
for direction in fused.unobservable:
    print("-", direction["why"])

# %%
errors = np.array([(x - truth[p.label]) / s for p, x, s in zip(fused.parameters, fused.values, fused.sigmas, strict=True)
                   if p.label in truth])  # fmt: skip
assert np.abs(errors).max() < 4, "an error of more than four stated sigmas would be a defect"
