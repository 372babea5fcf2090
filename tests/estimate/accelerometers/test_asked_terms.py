"""Terms that a person asks for: what a refusal offers can be fitted, what the recording lacks is named."""

import pytest

from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers import multiposition as norm_method
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.recording import read
from tests.golden import refused
from tests.paths import XSENS


def test_each_term_that_a_refusal_offers_is_one_that_the_recording_can_show():
    """What the sentence offers is fitted or declined; what it does not offer is refused with what is missing."""
    recording = read(XSENS)
    with pytest.raises(InputError, match="choose from") as caught:
        multiposition(recording, ("nonsense",))
    offered = str(caught.value).partition("choose from ")[2].split(", ")
    assert {"bias", "cubic_nonlinearity", "bias_drift"} <= set(offered)
    assert not {"bias_temperature", "bias_covariate", "pressure", "magnetic_field"} & set(offered)
    for term in offered[::4]:
        multiposition(recording, (term,))
    for term in ("bias_temperature", "vibration_rectification", "magnetic_field", "pressure"):
        with refused():
            multiposition(recording, (term,))


@pytest.mark.parametrize("before", [(), ("bias", "scale_factor")])
def test_a_term_pays_for_its_own_coefficients_whatever_else_was_asked_for(before, monkeypatch):
    """Where no linear term is asked for, a bias is fitted nevertheless, and is none of the terms that are tried."""
    counted, needed = [], norm_method.needed_significance
    monkeypatch.setattr(norm_method, "needed_significance", lambda n, dof: counted.append(n) or needed(n, dof))
    multiposition(read(XSENS), (*before, "cubic_nonlinearity"))
    assert counted == [3]
