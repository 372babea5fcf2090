r"""Systematic calibration: 30, 51 or any other states, by navigation in place (Cai et al. 2016, Wei et al. 2022).

A unit that stays in its place and is turned there is a navigator whose true velocity is known: zero. What it computes
instead is a linear function of the attitude it started with and of its sensors' errors, and no angle of the table is
asked for. Filter and smoother (`smoothing`) run about a reference; the reference takes over what they found (the
feedback of Cai's Eq. (27)), until nothing moves by 3 % of its sigma (`settle`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.calibration import Residual
from gimbalcal.effects import with_values
from gimbalcal.errors import amount
from gimbalcal.estimate.added import Added
from gimbalcal.estimate.systematic.bent import bent
from gimbalcal.estimate.systematic.evidence import outcome, told
from gimbalcal.estimate.systematic.seen import informed
from gimbalcal.estimate.systematic.settle import Settled, settle
from gimbalcal.estimate.systematic.slips import likely, limits
from gimbalcal.estimate.systematic.smoothing import attitude_covariance
from gimbalcal.estimate.systematic.states import states
from gimbalcal.inference.information import solve
from gimbalcal.number import Array
from gimbalcal.recording import Recording

ROUGHLY = np.radians(3.0)  # one sigma of a heading beyond which second order counts


def systematic(
    recording: Recording, asked: str = "51", more: Sequence[Added] = (), tell: Callable[[str], None] = lambda _: None
) -> Calibration:
    """Calibrate both triads of a unit that was turned in its place, with these states (`states`).

    Raises InputError where the recording is none that a navigator can take: see `course` and `alignment`.
    """
    m = settle(recording, states(asked, recording, more), tuple(a.absent((), dict(a.stated)) for a in more), tell)
    found = calibrated(m)
    if m.settled and (found.unobservable or m.last.attitude[2, 2] > ROUGHLY**2):
        found = _with_bend(found, bent(m, found.covariance))
    limits = [*found.provenance["limits"], *_of_the_table(recording)]
    options = {"states": asked, **found.provenance["options"]}
    return replace(found, provenance={**found.provenance, "options": options, "limits": limits})


def _of_the_table(recording: Recording) -> list[str]:
    """That the readout of a table is not used, in a list; empty where it logged none."""
    if not recording.has("gimbal_angle"):
        return []
    return [
        "what the table read is no reference: gravity and the turn of the Earth alone tell the scale of the gyroscopes"
    ]


def _with_bend(found: Calibration, bend: Array) -> Calibration:
    """With what second order does in its covariance, told where it is most of a sigma."""
    share = np.sqrt(np.diag(bend) / np.diag(found.covariance))
    worst = int(np.argmax(share))
    found = replace(found, covariance=found.covariance + bend)
    if share[worst] < 1.0:
        return found
    wider = (
        f"what these turns do not show makes {found.parameters[worst].label} "
        f"{np.hypot(1.0, share[worst]):.2g} times as uncertain as the noise does, by products of errors that no linear "
        f"estimate holds: its sigma says so ({amount(int(np.sum(share >= 1.0)), 'parameter')} like this)"
    )
    return replace(found, provenance={**found.provenance, "limits": [*found.provenance["limits"], wider]})


def calibrated(m: Settled) -> Calibration:
    """The calibration that passes ended in, with what the innovations say of it."""
    legs, wanted, before = m.course, m.wanted, m.before
    # what the data alone say, and the directions that they do not see
    found = solve(informed(wanted, m.last.factor, m.said - before, [p.sigma for p in wanted]))
    scale = np.array([p.sigma for p in wanted])
    smoothed = attitude_covariance(legs, m.last, m.left_out, found.covariance / np.outer(scale, scale))
    navigation = told(legs, wanted, m.last, m.C, m.passes, smoothed)
    words = outcome(navigation, 9 + len(wanted), m.settled, len(found.unobservable), lambda: likely(m))
    rms = {f"velocity {axis}": float(v) for axis, v in navigation.pop("velocity_rms").items()}
    return Calibration(
        method="systematic",
        effects=with_values(m.base, wanted, before + found.x),
        parameters=wanted,
        covariance=found.covariance,
        unobservable=tuple(each.to_dict() for each in found.unobservable),
        residual=Residual(navigation["nis"]["sum"], navigation["nis"]["dof"], rms, navigation),
        outcome=words,
        provenance={
            "options": {"velocity_m_per_s": legs.velocity, "stops": int(legs.stop.max()) + 1},
            "limits": limits(m, found.sigma),
        },
    )
