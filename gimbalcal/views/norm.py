r"""Dwells of unknown attitude: the corrected force is as long as gravity.

.. math:: r = |h^{-1}(y)| - g , \qquad \frac{\partial r}{\partial c_k} = u^T H^{-1} S_k ,

for h what the accelerometers read, H its derivative by the force and u the direction of the force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Counts, Readout
from gimbalcal.calibration.readout import in_si
from gimbalcal.effects import Effect, Stage
from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS
from gimbalcal.effects.effect import SENSOR_STAGES
from gimbalcal.errors import InputError, number_of
from gimbalcal.forward import Rows, accelerometers, linearise
from gimbalcal.inference.ellipsoid import MIN_POINTS, ellipsoid
from gimbalcal.inversion import invert_response
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.dwell import attitudes
from gimbalcal.recording.record import FORCE, FORCES
from gimbalcal.views.core import Measurement, View, gauge_parameters, recording_fields
from gimbalcal.views.noise import NoiseModel

NORM = Measurement(
    "norm", "mg", "positions", channels="the norm of the force", channel="the norm of the force", acts_on=(FORCE,),
    patterns=frozenset({"orientation", "sensors"}), reads_force=True,
)  # fmt: skip
MAX_FACE_TILT = 0.3  # of gravity, across an axis that is called upright
MAX_FACE_ERROR = 0.1  # of a scale by such an axis, twice what its tilt makes
SIX_TERMS = ("bias", "scale_factor")
NINE = 9  # bias, scale factor and the three misalignments that the norm sees
PAIRS = ((0, 1), (0, 2), (1, 2))
MIN_SHARE = 0.02  # of gravity rms by which a misalignment of 1 rad moves the norm, where bias and scale factor do not


def norm(recording: Recording, baseline: Sequence[str] = ()) -> View:
    """Return the view of dwells of unknown attitude: one row each. Gimbal angles are not used."""
    means, counts = scaled_by_gravity(dwell_means(recording))
    readout = Readout(counts, gimbals=means.platform.axis_names)
    channels = {k: x for k, x in means.channels.items() if k[0] != "gimbal_angle"}
    means = replace(means, platform=BENCH, channels=channels)
    y, g = means.triad(FORCE), means.site.gravity
    s = stimulus_from_readings(means).at(rate=np.zeros_like(y))  # at rest

    def rows(effects: Sequence[Effect], noise_free: bool = False) -> Rows:
        f, H = inverted(lambda f: accelerometers(f, s, effects), y)
        length = np.linalg.norm(f, axis=-1, keepdims=True)
        towards = np.linalg.solve(np.swapaxes(H, -1, -2), (f / length)[..., None])[..., 0]
        felt = s.at(force=g / length * f if noise_free else f)
        along = linearise(BENCH, felt, effects, channels=FORCES, stages=SENSOR_STAGES).reduced(
            lambda X: np.einsum("nc,ncp->np", towards, X)[:, None]
        )
        return replace(along, residual=length - g)

    sample = means.sigma("accelerometer")
    noise = (sample / np.sqrt(means.weight))[:, None] if sample else None  # a channel of few levels may not scatter
    return View(
        NORM, channels=((FORCE, "norm"),), **{**recording_fields(means), "readout": readout}, stimulus=s,
        label=s.position, evaluate=rows, reference=lambda effects: rows(effects, noise_free=True), stages=SENSOR_STAGES,
        baseline=tuple(baseline) or determined_terms(y), gauge=gauge_parameters(SENSOR_STAGES),
        groups=np.arange(len(y)),
        noise=NoiseModel(sample=noise, wander=(y / np.linalg.norm(y, axis=1)[:, None])[:, None]),
    )  # fmt: skip


def undetermined_misalignments(y: Array) -> tuple[str, ...]:
    """Return the pairs of axes whose misalignment dwells that read y (m, 3) do not determine with bias and scale.

    With u the direction of the force, the norm moves by u_i per bias, u_i^2 per scale factor and u_i u_j per
    misalignment, so that of six faces none is seen.
    """
    u = y / np.linalg.norm(y, axis=1, keepdims=True)
    products = np.stack([u[:, i] * u[:, j] for i, j in PAIRS], axis=1)
    Q = np.hstack([u, u**2])
    remainder = products - Q @ (np.linalg.pinv(Q) @ products)
    share = np.sqrt(np.mean(remainder**2, axis=0))
    return tuple("xyz"[i] + "xyz"[j] for (i, j), s in zip(PAIRS, share, strict=True) if s < MIN_SHARE)


def determined_terms(y: Array) -> tuple[str, ...]:
    """Return bias, scale factor and misalignment; without the last where dwells y (m, 3) cannot determine it.

    Nine terms take more than nine attitudes, as nothing would test them else.
    """
    spare = attitudes(y) > NINE
    return ACCELEROMETER_TERMS if spare and not undetermined_misalignments(y) else SIX_TERMS


def in_noise_of_readings(view: View) -> View:
    """Return the view of the norm with rows over |H^-T u|, whose noise is that of a reading at any scale factor.

    Derivatives are those at a force as long as gravity: at the force that was read they would hold its noise, and pull
    estimates towards zero.
    """

    def rows(effects: Sequence[Effect]) -> Rows:
        along = view.noise_free(effects)
        one = np.ones((len(view), 1))
        towards = [along.added(Stage.ACCELEROMETER, i, one)[:, :, 0] for i in range(3)]
        return along.over(np.sqrt(np.sum(np.square(towards), axis=0)))

    return replace(view, evaluate=rows)


def inverted(h: Callable[[Array], Array], y: Array) -> tuple[Array, Array]:
    """Return f (n, 3) with h(f) = y, and dh/df (n, 3, 3) there.

    Raises InputError where different forces read the same.
    """
    f, H, flat = invert_response(h, y)
    if np.any(flat):
        raise InputError(
            "in the model of the accelerometers different forces read the same; name bias, scale_factor and "
            "misalignment in --baseline, and no dead_zone"
        )
    return f, H


def scaled_by_gravity(means: Recording) -> tuple[Recording, Counts | None]:
    """Return readings in counts or pulses as m/s^2, by a scale and an offset that are kept as nominal.

    They are those of the ellipsoid through nine dwells or more; else of six faces, half of what an axis reads upward
    less what it reads downward, and the mean of both. Through dwells on faces alone an ellipsoid may have any size, so
    that it is not taken where it is far from that of the faces.
    """
    if not means.counted(FORCE):
        return means, None
    N = means.triad(FORCE)
    half, middle = (N.max(0) - N.min(0)) / 2, (N.max(0) + N.min(0)) / 2
    spread = half.mean()
    on_faces = bool(np.all(half > 0)) and _on_faces((N - middle) / half)
    solution = ellipsoid(((N - middle) / spread)[None])[0] if len(N) >= MIN_POINTS else np.full(9, np.nan)
    far = on_faces and np.max(np.abs(solution[:3] * half / spread - 1)) > MAX_FACE_ERROR
    if np.isfinite(solution).all() and not far:
        scale = solution[:3] * means.site.gravity / spread
        offset = middle - solution[3:6] / solution[:3] * spread
    elif on_faces:
        scale, offset = means.site.gravity / half, middle
    else:
        unit = means.units.get((FORCE, "x"), "m/s^2")
        raise InputError(
            f"{means.title!r} reads in {unit} and "
            f"{number_of(len(N), 'rest position')} cannot fix its scale: hold six faces up, or at least "
            "nine that turn every axis up and down, or give the columns in m/s^2"
        )
    counts = Counts(tuple(map(float, scale)), tuple(map(float, offset)))
    return in_si(means, Readout(accelerometers=counts)), counts


def _on_faces(n: Array) -> bool:
    """Return whether dwells n (m, 3), each axis from -1 to 1, hold every axis upright both ways."""
    ends = n[np.concatenate([n.argmax(0), n.argmin(0)])]
    across = ends[~np.tile(np.eye(3, dtype=bool), (2, 1))]
    return bool(np.all(np.abs(across) < MAX_FACE_TILT))
