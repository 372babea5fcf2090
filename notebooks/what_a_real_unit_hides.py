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
# # What a real unit hides
#
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md in this folder.*
#
# The errors of a real unit are unknown. An answer can be tested in three ways: with held-out data, with the same data
# in another order, and with a recording in which nothing should be found. The example is an Xsens MTi turned by hand,
# 38 dwells (its accelerometers ship with the project; Tedaldi, Pretto and Menegatti 2014), and its gyroscopes if the
# raw files are available.

# %%
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gimbalcal
from gimbalcal.cli.demonstration import shipped
from gimbalcal.importers import import_files

xsens = gimbalcal.read(shipped() / "xsens_positions")
RAW = [Path("../shared/data/imu_tk_xsens") / name for name in ("xsens_acc.mat", "xsens_gyro.mat")]

# %% [markdown]
# ## Omitted on purpose: misalignment
#
# With bias and scale factor only, 3.4 mg of the norm of gravity remain. The misalignment is identified, and then an
# effect that a textbook calibration does not contain.

# %%
found = gimbalcal.diagnose(xsens, baseline=["bias", "scale_factor"])
print(found.in_words)
print(found.to_frame().select("effect", "probability", "in_sigmas", "parameter", "value", "sigma", "unit"))

# %% [markdown]
# ## Where is the misfit?
#
# Residuals of the norm in each dwell, in mg: with bias and scale factor, with misalignment, and with drift. The second
# looks like noise; against time it is not: neighbours are correlated once the attitudes are accounted for.

# %%
lean = gimbalcal.diagnose(xsens)  # its model holds misalignment from the start
assert found.curves.units == lean.curves.units == ("mg",)
steps = (
    ("bias, scale factor", found.curves.before * found.curves.sigma),
    ("with misalignment", lean.curves.before * lean.curves.sigma),
    ("with the drift too", lean.curves.after * lean.curves.sigma),
)
fig, panels = plt.subplots(1, 3, figsize=(10, 3), layout="constrained")
for panel, (name, rest) in zip(panels, steps, strict=True):
    panel.axhline(0, color="black", linewidth=0.6)
    panel.plot(np.arange(1, len(rest) + 1), rest[:, 0], "o-", ms=4, linewidth=0.6, color="#0072B2")
    panel.set(title=f"{name}: {np.std(rest):.3f} mg rms", xlabel="rest, in order of time")
panels[0].set_ylabel("norm of the force - gravity [mg]")
plt.show()

# %% [markdown]
# ## Is it real?
#
# Each dwell is predicted from a fit without it. And if the biases change in *time*, the same dwells in random order
# must not show a drift: attitudes, readings and noise are the same.

# %%
fit = found.fit
print(f"kept out of the fit: {fit['heldout_rms_before']:.3g} mg without, {fit['heldout_rms_after']:.3g} mg with")
order = np.random.default_rng(1).permutation(len(xsens.time))
shuffled = replace(xsens, channels={key: values[order] for key, values in xsens.channels.items()})
print("in the order of time: ", lean.verdict, [f["effect"] for f in lean.findings])
again = gimbalcal.diagnose(shuffled)
print("in a random order:    ", again.verdict, [f["effect"] for f in again.findings])

# %% [markdown]
# ## What these data cannot show
#
# The drift has no equation; a step of the biases fits nearly as well, and the answer names both. Quadratic and cubic
# terms are omitted by the calibration, with upper limits of their size; and a unit turned by hand has no known
# attitude.

# %%
for f in lean.findings:
    print(f["effect"], "- may as well be:", ", ".join(f["twins"]) or "nothing else")
for u in gimbalcal.calibrate(xsens).unobservable:
    print("-", u["why"])

# %% [markdown]
# ## Its gyroscopes, if the raw files are available
#
# At rest, a gyroscope should show a constant bias. Here the bias depends on the attitude. Nine coefficients, force to
# rate, are estimated at rest; the turns between the dwells are not used, and gravity propagated through them deviates
# three times less.

# %%
if all(path.is_file() for path in RAW):
    turned = gimbalcal.diagnose(import_files("imu-tk", RAW), baseline=["gyro_bias"])
    print(turned.in_words)
    turns = turned.fit["turns"]
    print(
        f"gravity after a turn, missed by {turns['rms_before']:.0f} {turns['unit']} before, {turns['rms_after']:.0f} after"
    )
    c = turned.curves
    fig, panels = plt.subplots(1, 3, figsize=(10, 3), sharey=True, layout="constrained")
    for k, panel in enumerate(panels):
        panel.axhline(0, color="black", linewidth=0.6)
        panel.plot(c.before[:, k] * c.sigma[:, k], "o", ms=4, color="#999999", label="bias alone")
        panel.plot(c.after[:, k] * c.sigma[:, k], "o", ms=4, color="#0072B2", label="with g-sensitivity")
        panel.set(title=f"gyroscope {c.channels[k][1]}", xlabel="rest")
    panels[0].set_ylabel("rate at rest [deg/h]")
    panels[0].legend()
    plt.show()
else:
    print(f"{RAW[0].parent} is not here: this part needs xsens_acc.mat and xsens_gyro.mat of github.com/Kyle-ak/imu_tk")
