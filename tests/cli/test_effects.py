"""--effects FILE.py: a user's effects work as those of the catalogue do; what is wrong with them is one sentence."""

import json
from collections.abc import Callable
from hashlib import sha256
from importlib.metadata import EntryPoint

import pytest

import gimbalcal
from gimbalcal.calibration import Provenance
from gimbalcal.campaign.task import compute_runs, task
from gimbalcal.effects import CATALOGUE, loading
from gimbalcal.effects.loading import contract_breach, load_effects, load_installed
from gimbalcal.errors import InputError
from tests.fuzzing.seeds import LAW
from tests.golden import golden_text, refused

Run = Callable[..., int]
OWN = LAW.replace("import Array", "import Array, absolute")
SCENARIO = """
format = 1
kind = "multi-position"
seed = 5
site.latitude = { value = 40.0, unit = "deg" }
schedule = { name = "wu2018-18", dwell = { value = 1.0, unit = "min" }, rate = { value = 0.1, unit = "Hz" } }
[noise]
accelerometer = { value = 10.0, unit = "ug" }
[truth.twisted_spring]
z = 200.0
"""


pytestmark = pytest.mark.usefixtures("own_catalogue")


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "scenario.toml").write_text(SCENARIO)
    return tmp_path / "own.py"


def test_simulate_calibrate_and_apply_take_it(own, command, capsys):
    there = own.parent
    with_it = ("--effects", own, "--quiet", "--out")
    assert command("simulate", there / "scenario.toml", *with_it, there / "rec") == 0
    assert command("calibrate", there / "rec", "--with", "twisted_spring:z", *with_it, there / "made") == 0
    rows = json.loads((there / "made" / "calibration.json").read_text())["parameters"]
    twist = next(r for r in rows if r["name"] == "twist")
    assert abs(twist["value"] - 200) < 4 * twist["sigma"] < 100
    assert (
        command("apply", there / "rec", "--calibration", there / "made" / "calibration.json", *with_it, there / "a")
        == 0
    )
    assert command("catalogue", "twisted_spring", "--effects", own) == 0
    assert "force times its cube" in capsys.readouterr().out


def test_the_catalogue_checks_a_file(own, command, capsys):
    assert command("catalogue", "--check", own) == 0
    golden_text(capsys.readouterr().out)
    assert command("catalogue", "--check", own, "gsens") == 2
    golden_text(capsys.readouterr().err)
    own.write_text(OWN.replace("self.w *", "np.abs(self.w) *"))
    assert command("catalogue", "--check", own) == 2
    golden_text(capsys.readouterr().err)
    own.write_text(OWN.replace("    stage =", '    domain = ("force",)\n    stage =', 1))
    assert command("catalogue", "--check", own) == 2
    golden_text(capsys.readouterr().err)


def test_a_calibration_says_that_it_needs_the_file(own, command, capsys):
    there = own.parent
    command("simulate", there / "scenario.toml", "--effects", own, "--quiet", "--out", there / "rec")
    command("calibrate", there / "rec", "--with", "twisted_spring:z", "--quiet", "--out", there / "made")
    del CATALOGUE["twisted_spring"]
    capsys.readouterr()
    assert command("apply", there / "rec", "--calibration", there / "made" / "calibration.json") == 2
    said = capsys.readouterr().err
    golden_text(said)


def test_a_result_says_which_definitions_it_was_made_with(own, command, capsys):
    there, file = own.parent, {"path": str(own), "sha256": sha256(OWN.encode()).hexdigest()}
    rec, made = there / "rec", there / "made" / "calibration.json"
    command("simulate", there / "scenario.toml", "--effects", own, "--quiet", "--out", rec)
    assert command("calibrate", rec, "--with", "twisted_spring:z", "--effects", own, "--out", there / "made") == 0
    command("calibrate", rec, "--quiet", "--out", there / "without")
    command("diagnose", rec, "--quiet", "--out", there / "found")
    results = ("made/calibration", "without/calibration", "found/diagnosis", "found/calibration")
    told = [json.loads((there / f"{name}.json").read_text())["provenance"].get("effects") for name in results]
    assert told == [[file | {"effects": ["twisted_spring"]}], None, *2 * told[:1]]
    for page in ("made", "found"):
        text = (there / page / "report.html").read_text()
        assert f"{own}, which defines twisted_spring" in text
        assert file["sha256"] in text
    own.write_text(OWN.replace("** 3", "** 2"))
    capsys.readouterr()
    for what in (("apply", rec, "--calibration", made), ("compare", made, there / "without" / "calibration.json")):
        assert command(*what, "--effects", own, "--out", there / "a") == 2
        golden_text(capsys.readouterr().err)
    del CATALOGUE["twisted_spring"]
    assert command("compare", made, there / "without" / "calibration.json", "--out", there / "a") == 2
    golden_text(capsys.readouterr().err)


@pytest.mark.parametrize("rows", [3, [3], [{"path": "a"}], [{"path": "a", "sha256": 1, "effects": []}]])
def test_files_of_effects_that_are_none_are_refused(rows):
    with refused():
        Provenance.read({"effects": rows})


def changed(*pairs):
    """OWN with each odd string replaced by the one after it."""
    text = OWN
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    return text


LAG = (
    "effect, parameter\n",
    "constant, effect, parameter\n",
    'name="twist")\n',
    'name="twist")\n    tau: float = constant(9.0, unit="s", low=1.0, high=99.0)\n',
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = (", "own.py line 1: SyntaxError: '(' was never closed"),
        ("import nowhere_at_all", "own.py line 1: ModuleNotFoundError: No module named"),
        ("\nraise SystemExit", "own.py line 2: SystemExit"),
        ("x = 1", "own.py defines no effect; write a class under @effect"),
        (changed('"twisted_spring"', '"bias"'), "line 7: two effects are called 'bias': Bias and TwistedSpring"),
        (changed("self.w *", "1e-6 + self.w *"), "adds something although its parameters are zero"),
        (changed("self.w *", "np.abs(self.w) *"), "loses its derivative; take absolute"),
        (changed("self.w *", "self.w * absolute(self.w) *"), "is not linear in its parameters"),
        (changed(*LAG, "self.w *", "self.w * np.abs(self.tau) *"), "loses its derivative by tau; take absolute"),
        (changed("self.w *", "self.w * np.cosh(np.abs(s.force / 9.8)) *"), "loses its derivative by the force"),
        (changed(*LAG[:3], LAG[3].replace("constant(9.0", "constant(0.5")), "0.5, outside its range of 1 to 99 s"),
        (changed("self.w *", "self.w[0] *"), "adds an array of shape (12, 1)"),
        (changed("self.w *", "self.v *"), "fails on a recording that has everything: AttributeError"),
        (changed("ug/g^4", "furlong"), "cannot be used: the unit 'furlong' is not known"),
        (changed('name="twist"', 'name="K3"'), "calls a parameter 'K3', as cubic_nonlinearity does"),
        (changed("sigma=50", "sigma=0"), "has a parameter twist whose sigma (or range) is 0"),
        (changed("    stage = Stage.ACCELEROMETER\n", ""), "says no stage; write stage = Stage.NAME"),
        (changed('id = "twisted_spring"', 'id = "twisted spring"'), "has an id that is no name"),
        (changed("    stage =", '    requires = ("gimbal_angle",)\n    stage ='), "requires 'gimbal_angle'; an effect"),
        (changed("self.w *", "self.w * s.force[:, :1].mean() *"), "follows the force or the angle at other rows"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_sentence(text, said, own):
    own.write_text(text)
    before = dict(CATALOGUE)
    with pytest.raises(InputError) as told:
        load_effects(own)
    assert said in str(told.value)
    assert dict(CATALOGUE) == before


def test_a_missing_file_and_one_that_is_no_text_are_refused(own, command, capsys):
    assert command("catalogue", "--effects", own.parent / "other.py") == 2
    golden_text(capsys.readouterr().err)
    own.write_bytes(b"\xff\xfe\x00")
    assert command("catalogue", "--effects", own) == 2
    golden_text(capsys.readouterr().err)


def test_a_file_is_run_again_when_it_changed(own):
    assert gimbalcal.load_effects(own) == ("twisted_spring",) == gimbalcal.load_effects(own)
    own.write_text(OWN.replace("twisted_spring", "bent_spring"))
    assert gimbalcal.load_effects(own) == ("bent_spring",)
    assert "twisted_spring" not in CATALOGUE
    own.write_text("x = (")
    with pytest.raises(InputError):
        gimbalcal.load_effects(own)
    assert "bent_spring" in CATALOGUE


def test_installed_packages_bring_theirs(own, monkeypatch):
    monkeypatch.syspath_prepend(str(own.parent))
    monkeypatch.setattr(loading, "entry_points", lambda group: [EntryPoint("mine", "own", group)])
    load_installed()
    assert "twisted_spring" in CATALOGUE
    monkeypatch.setattr(loading, "entry_points", lambda group: [EntryPoint("mine", "nowhere_at_all", group)])
    with refused():
        load_installed()


def test_workers_of_a_campaign_load_it_themselves(own):
    load_effects(own)
    what = task(own.parent / "scenario.toml")
    assert what.identity["effects"] != []
    del CATALOGUE["twisted_spring"]  # as in a new process
    loading._loaded.clear()
    assert {"bias:x", "bias:z"} <= set(compute_runs(what, range(1))["parameter"])
    assert "twisted_spring" in CATALOGUE


@pytest.mark.parametrize("effect", sorted(CATALOGUE))
def test_the_catalogue_keeps_the_contract_that_it_asks_of_others(effect):
    assert contract_breach(CATALOGUE[effect]) == ""


def test_the_catalogue_prints_constants_with_their_range(command, capsys):
    assert command("catalogue", "post_move_creep") == 0
    assert "tau [min]: usually 5, from 0.3333 to 60; a time constant" in capsys.readouterr().out
