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
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md beside it.*
#
# No gimbals, no angles, raw counts. All that is known is that gravity has the same size in every position. How far does
# that go, and where does the recording stop supporting more?

# %%
import matplotlib.pyplot as plt
import numpy as np

from gimbalcal.cli.demonstration import shipped
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.pipeline import load

(xsens,) = load([shipped() / "xsens_positions"])
print(xsens.title, "-", len(xsens.time), "positions at rest")

# %% [markdown]
# First bias and scale factor only, then with the input axes free to lean, then everything the paper's polynomial has.

# %%
few = multiposition(xsens, ["bias", "scale_factor"])
lean = multiposition(xsens, ["bias", "scale_factor", "misalignment"])
full = multiposition(xsens)
for name, calibration in (("bias, scale", few), ("+ misalignment", lean), ("all terms offered", full)):
    print(f"{name:18s} {calibration.stages[-1].rms / 9.80665e-3:7.3f} mg rms")

# %% [markdown]
# Leaning axes take the misfit from milli-g to a tenth of a milli-g. Second and third order are *declined*, and
# the reasons are given: the coefficients would be known worse than they are expected to be anyway, and positions left out
# are predicted no better.

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
