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
# # A real recording: an Xsens unit turned by hand
#
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md in this folder.*
#
# No gimbals, no angles, raw counts. All that is known is that the norm of the force at rest is gravity in every
# attitude. How far is this sufficient, and which terms does the recording no longer support?

# %%
import matplotlib.pyplot as plt
import numpy as np

from gimbalcal.cli.demonstration import shipped
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.pipeline import load

(xsens,) = load([shipped() / "xsens_positions"])
print(xsens.title, "-", len(xsens.time), "positions at rest")

# %% [markdown]
# First bias and scale factor only, then with misalignment, then with every term of the paper's polynomial.

# %%
few = multiposition(xsens, ["bias", "scale_factor"])
lean = multiposition(xsens, ["bias", "scale_factor", "misalignment"])
full = multiposition(xsens)
for name, calibration in (("bias, scale", few), ("+ misalignment", lean), ("all terms offered", full)):
    print(f"{name:18s} {calibration.stages[-1].rms / 9.80665e-3:7.3f} mg rms")

# %% [markdown]
# Misalignment reduces the misfit from milli-g to a tenth of a milli-g. Quadratic and cubic terms are *omitted*, with
# the reasons: the coefficients would be less certain than their usual size, and held-out positions are predicted no
# better.

# %%
for direction in full.unobservable:
    print("-", direction["why"])

# %%
f = xsens.triad("specific_force")
fig, axes = plt.subplots(figsize=(7, 3))
norm = np.linalg.norm(f - f.mean(axis=0), axis=1)
axes.plot(norm / np.median(norm), "o", ms=4, color="#999999")
axes.set(xlabel="position", ylabel="norm of the raw counts,\nabout their mean / median")
plt.show()
