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
# # What do 18 positions show?
#
# *A notebook as text: VS Code, PyCharm and Spyder run it cell by cell; for Jupyter see README.md in this folder.*
#
# Wu et al. (2018) turn a space-stable platform through 18 positions and fit 18 coefficients. Which of them can such a
# recording determine, how well, and which not at all? The answer needs no recording: it follows from the derivatives of
# the forward model by each coefficient.

# %%
import matplotlib.pyplot as plt
import numpy as np

from gimbalcal import CATALOGUE, EIGHTEEN_POSITIONS, SPACE_STABLE
from gimbalcal.effects import parameters

# %% [markdown]
# The schedule is data: gimbal angles in units of 45 deg. The gravity along each accelerometer follows from the gimbal
# chain. Six positions put an axis along the vertical; twelve put two axes at 45 deg to it.

# %%
g = EIGHTEEN_POSITIONS.gravity_directions()
fig, axes = plt.subplots(figsize=(9, 2.2))
axes.imshow(g.T, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
axes.set(xticks=range(18), xticklabels=range(1, 19), yticks=range(3), yticklabels="xyz", xlabel="position")
for (i, j), value in np.ndenumerate(g.T):
    axes.text(j, i, f"{value:+.2f}" if abs(value) > 1e-9 else "0", ha="center", va="center", fontsize=7)
axes.set_title("gravity along the platform axes [g]")
plt.show()

# %% [markdown]
# Each column below is one coefficient, each row one accelerometer in one position: the change of the reading for a
# coefficient of its usual size. A column of zeros would be an unobservable coefficient.

# %%
from gimbalcal.design.position_observability import observe

seen = observe("wu2018-18")
for sentence in seen.in_words.splitlines():
    print(sentence)

# %%
wanted = [
    p
    for effect in ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero")
    for p in parameters(CATALOGUE[effect], SPACE_STABLE.axis_names)
    if p.axis != "outer"  # turns about the vertical of a level base: no accelerometer can tell
]
print(len(wanted), "coefficients:", ", ".join(p.label for p in wanted))

# %% [markdown]
# One combination is unobservable, because of geometry and not of noise: if the platform's zero and the input axes of x
# and y turn by the same angle, no reading changes. The paper's Table 1 shows it (theta_10 never enters with a sign of
# its own), and a longer recording would not help. The package fixes it by a stated convention and reports it.

# %%
for direction in seen.solution.unobservable:
    print(direction.why)
