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
# # Fifteen positions and nine revolutions, angles unknown
#
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md in this folder.*
#
# Wang, Cheng and Fu (2019) calibrate sensors that are read in pulses by a polynomial per axis: accelerometers from
# fifteen positions, because the norm of the force at rest is gravity, and gyroscopes from nine revolutions both ways,
# because a whole turn is closed. How much does the error of the turntable matter, and is the fit as accurate as the
# noise allows? What the paper does not print (duration of a position, number and rate of turns) is stated in
# `gimbalcal/campaign/trials.py`.

# %%
import matplotlib.pyplot as plt
import numpy as np

from gimbalcal.campaign.trials import accelerometers, gyroscopes

RUNS, SEED = 100, 2019
TURNTABLES = {"3 arcsec": 3 / 3600, "3 arcmin": 3 / 60, "3 deg": 3.0}  # deg
NAMES = [f"{n}:{a}" for n in ("K1", "K2", "K3", "bias") for a in "xyz"] + ["E:yx", "E:zx", "E:zy"]

# %% [markdown]
# ## RMS error over the Cramer-Rao bound
#
# One value per parameter. 1 is optimal; a hundred runs scatter by 7 %. The last column is the ratio for the worst
# parameter, which the turntable does not change: no angle of it is used.

# %%
ratios = {}
for triad, simulated in (("accelerometers", accelerometers), ("gyroscopes", gyroscopes)):
    for name, tilt in TURNTABLES.items():
        trials = simulated(SEED, range(RUNS), np.deg2rad(tilt))
        rms = np.sqrt(np.mean(trials.error**2, axis=0))
        bound = np.sqrt(np.mean(trials.fit.sigma**2, axis=0))
        estimated = bound > 0  # gyroscopes have no cubic term
        ratios[triad, name] = rms[estimated] / bound[estimated]
        print(
            f"{triad:15s} {name:9s} median {np.median(ratios[triad, name]):.2f}  largest {ratios[triad, name].max():.2f}"
        )

# %%
fig, axes = plt.subplots(1, 2, figsize=(9, 3), sharey=True)
for ax, triad in zip(axes, ("accelerometers", "gyroscopes"), strict=True):
    names = NAMES if triad == "accelerometers" else [n for n in NAMES if not n.startswith("K3")]
    for name in TURNTABLES:
        ax.plot(names, ratios[triad, name], "o", label=f"turntable {name}")
    ax.axhline(1.0, color="grey", lw=1)
    ax.tick_params(axis="x", rotation=90)
    ax.set_title(triad)
axes[0].set_ylabel("RMS error / bound")
axes[0].legend()
fig.tight_layout()

# %% [markdown]
# ## Both senses of a revolution
#
# Eq. (30) of the paper uses the difference of the two senses only. The quadratic term nearly cancels in it; the sum of
# the two senses holds it in full, without any angle.

# %%
difference = gyroscopes(SEED, range(RUNS), np.deg2rad(3.0), both_senses=False)
both = gyroscopes(SEED, range(RUNS), np.deg2rad(3.0))
for name in ("K1:x", "K2:x", "E:yx"):
    k = NAMES.index(name)
    sigma = [float(np.median(t.fit.sigma[:, k])) for t in (difference, both)]
    print(f"sigma of {name}: difference only {sigma[0]:.2g}, both {sigma[1]:.2g} (SI per pulse, pulse^2, or rad)")
