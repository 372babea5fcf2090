"""`--store` and `compare` as a user meets them."""

import json

import numpy as np

from tests.golden import golden_text
from tests.history.calibrations import calibration
from tests.paths import XSENS


def test_a_store_grows_and_is_compared(command, capsys, tmp_path):
    store, out = tmp_path / "unit.db", tmp_path / "out"
    for _ in range(2):
        command("calibrate", XSENS, "--method", "multiposition", "--store", store, "--unit", "MTi", "--quiet")
    capsys.readouterr()
    assert command("compare", "--store", store) == 2
    golden_text(capsys.readouterr().err)
    files = []
    for k, jump in enumerate((0, 0, 40)):
        files.append(tmp_path / f"{k}.json")
        files[-1].write_text(json.dumps(calibration(100 + jump * np.eye(6)[1], k).to_dict()))
    assert command("compare", *files[:2]) == 0
    assert "agree within their sigmas in all 6 parameters" in capsys.readouterr().out
    assert command("compare", *files, "--out", out, "--allow", "bias=5 mg", "--json", "--quiet") == 1
    content = json.loads(capsys.readouterr().out)
    assert content == json.loads((out / "compare.json").read_text())
    assert [p["jumps"] for p in content["parameters"][:3]] == [[], [2], []]
    assert sorted(p.name for p in out.iterdir()) == ["compare.json", "history.csv", "history.parquet", "report.html"]
    assert command("compare", *files, "--allow", "bias") == 2
