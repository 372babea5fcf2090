"""Every effect adds what its source says: an independent number for each, and the formula of its card, read."""

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, Effect
from tests.effects.mount_laws import MOUNT_LAWS
from tests.effects.sensor_laws import SENSOR_LAWS
from tests.effects.stimulus import example, given

LAWS = {**SENSOR_LAWS, **MOUNT_LAWS}
ALL = sorted(CATALOGUE)
SEEDS = (1, 2)


def off_its_law(name: str, cls: type[Effect] | None = None) -> float:
    """Largest difference from the independent number, as a share of the largest number, over random stimuli."""
    worst = 0.0
    for seed in SEEDS:
        s, made = given(seed), example(name, cls)
        expected, found = LAWS[name][1](s, made), made.contribution(s)
        assert found.shape == expected.shape, f"{name} returns {found.shape}, its law {expected.shape}"
        worst = max(worst, float(np.abs(found - expected).max() / np.abs(expected).max()))
    return worst


def test_every_effect_has_a_law_of_its_own() -> None:
    missing = sorted(set(CATALOGUE) - set(LAWS))
    assert not missing, (
        f"{missing}: write the law again from its source, in plain numpy, in tests/effects/sensor_laws.py or "
        "tests/effects/mount_laws.py: an entry `id: (source, lambda s, p: ...)` with the stimulus s and the fields of p"
    )
    assert sorted(LAWS) == ALL, f"{sorted(set(LAWS) - set(CATALOGUE))} left the catalogue: delete the law too"


@pytest.mark.parametrize("name", ALL)
def test_contribution_is_the_independent_number(name: str) -> None:
    assert off_its_law(name) < 1e-12
