r"""The one forward model: gimbal angles, time and environment in, sensor readings out.

This is the only place where the stages of `effects` meet. Kinds of recording differ in what holds still:

* *encoder-referenced* (multi-position, rotation): the readouts say where the platform points,

  .. math:: f^p = -C_b^p(\theta) \, C_n^b \, g^n, \qquad \theta = \text{readout} + \delta\theta ;

* *inertially fixed* (static run): the gyroscopes hold the platform, the Earth turns under it, and the gimbal angles
  are a result,

  .. math:: f^p / g = R(\varphi) (\cos S_t \cos L, \; \sin S_t \cos L, \; \sin L), \qquad
            C_b^p(\theta) = R(\varphi) \, C_n^p(S_t, L) \, {C_n^b}^T .

* *pointing*: a telescope or antenna is given a direction; what a pointing model leaves is the direction seen across
  and along the innermost gimbal,

  .. math:: v = {C_n^b}^T {C_b^p(\theta)}^T R(\text{line of sight})^T \, x_p ,

  against the target, in the axes in which a perfect mount would see it.

Where the unit turns, gyroscopes in the same block read its angular rate against the inertial frame.

`predict` returns the outputs of every channel; `linearise` holds them against what was read and returns `Rows`:
residuals and their exact derivatives by what is added at each stage, from which the derivative by any parameter is one
product.
"""

from gimbalcal.forward.angles import navigator_attitude_error, nearest_angles
from gimbalcal.forward.model import (
    accelerometers,
    angular_rate,
    attitude,
    gyroscopes,
    on_target,
    predict,
    rate_of_chain,
)
from gimbalcal.forward.rows import ANGLES, AXES, Rows, difference, jacobian, linearise, wanted_channels

__all__ = [
    "ANGLES",
    "AXES",
    "Rows",
    "accelerometers",
    "angular_rate",
    "attitude",
    "difference",
    "gyroscopes",
    "jacobian",
    "linearise",
    "navigator_attitude_error",
    "nearest_angles",
    "on_target",
    "predict",
    "rate_of_chain",
    "wanted_channels",
]
