"""A kind is its name, wherever a string goes, with the properties of that kind."""

import copy
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.entries import plain_json
from gimbalcal.platform import BENCH, SPACE_STABLE
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.kinds import HAND_TURNED, KINDS, MULTI_POSITION, Kind


def recording(kind, platform=SPACE_STABLE):
    return Recording(kind, "", platform, Site(), {}, np.zeros(0), None, {})


@pytest.mark.parametrize("name", KINDS)
def test_a_kind_is_its_name(name):
    kind = recording(name).kind
    assert kind == name
    assert f"{kind}" == name
    assert json.loads(json.dumps({"kind": kind})) == {"kind": name}
    assert json.loads(json.dumps(plain_json({"kind": kind}))) == {"kind": name}
    for copied in (pickle.loads(pickle.dumps(kind)), copy.deepcopy(kind)):
        assert isinstance(copied, Kind)
        assert copied == kind
        assert vars(copied) == vars(kind)


@pytest.mark.parametrize("name", KINDS)
def test_a_kind_is_tested_in_one_way(name):
    kind = KINDS[name]
    assert sum((kind.in_positions, kind.stabilised, kind.rotating, kind.sighting)) == 1


def test_without_gimbals_positions_are_laid_down_by_hand():
    by_hand = recording("multi-position", BENCH)
    assert by_hand.kind is HAND_TURNED
    assert by_hand.kind == MULTI_POSITION
    assert replace(by_hand, platform=SPACE_STABLE).kind is MULTI_POSITION


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match=r"`kind` must be one of .*, got 'swing'"):
        recording("swing")
