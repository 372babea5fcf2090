"""Every kind of page in a real browser at the width of a phone, a tablet and a desk: none wider, no complaint.

Skipped where no Chromium is. One start serves all pages: they stand in frames of these widths and tell their own.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from html import unescape

import numpy as np
import pytest

from gimbalcal.design.observability import observe
from gimbalcal.design.optimal import design, rig_of
from gimbalcal.report import calibration_report
from gimbalcal.report.diagnosis_page import diagnosis_report, panels
from gimbalcal.report.history import history_report
from gimbalcal.report.plan_page import design_report, plan_report
from tests.report.example import example
from tests.report.test_diagnosis_page import CUBIC, curves, diagnosis

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
WIDTHS = (390, 800, 1400)
LONG = "Bench_4-of-the-laboratory_with-a-title-that-nobody-broke_" * 4

ASK = """<!doctype html><title>asked</title><body>{frames}<script>
addEventListener("load", () => {{
  const told = [...document.querySelectorAll("iframe")].map((f) => {{
    const page = f.contentDocument, root = page.documentElement;
    const out = (e) => e.getBoundingClientRect().right > root.clientWidth + 1 && !e.closest(".scroll, .equation, svg");
    const wide = [...page.querySelectorAll("body *")].filter(out).map((e) => e.tagName + e.textContent.slice(0, 40));
    const svg = page.querySelector("figure svg");
    svg?.dispatchEvent(new f.contentWindow.PointerEvent("pointermove", {{clientX: 0, clientY: 0}}));
    svg?.dispatchEvent(new f.contentWindow.MouseEvent("click"));
    const opened = page.querySelectorAll("dialog[open] svg").length;
    const beyond = root.scrollWidth - root.clientWidth;
    return [f.dataset.page, +f.dataset.width, beyond, +root.dataset.charts, opened, wide.slice(0, 3)];
  }});
  document.body.textContent = "@@" + JSON.stringify(told) + "@@";
}});</script>"""


@cache
def pages() -> dict[str, str]:
    """A page of every kind."""
    content, recordings, truth = example()
    seen = curves()
    warm = {"temperature [°C]": np.linspace(15, 25, 360)}
    known = replace(seen, sigma=np.full((360, 2), 5.0), units=("ug", "ug"), against=warm)
    twin = CUBIC | {"twins": ["odd_quadratic"], "separate_by": "Tilt by 30 and 60 degrees."}
    unknown = diagnosis("unexplained", findings=[], unexplained=[{"channel": "x", "shape": "grows with time"}])
    parts = (panels(known, [{"channel": "specific_force", "axis": "y"}]), LONG, known)
    schedule, report = design(rig_of("space-stable", 90, None), 6, ("bias",))
    return {
        "calibration": calibration_report(content, recordings, truth),
        "diagnosis": diagnosis_report(diagnosis(), *parts),
        "open": diagnosis_report(diagnosis("not-identifiable", findings=[twin]), *parts),
        "unexplained": diagnosis_report(unknown, *parts),
        "observe": plan_report(observe("wu2018-18", candidates=["cross_coupling"]).to_dict()),
        "design": design_report(report, schedule),
        "history": history_report(HISTORY),
    }


HISTORY = {
    "unit": LONG, "in_words": "bias y jumped by 3 mg.", "agree": False, "due": "2027-01-01",
    "calibrations": [{"date": f"2026-0{k}-01T00:00:00+00:00", "name": LONG, "method": "three-stage", "outcome": ""}
                     for k in (1, 2, 3)],
    "steps": [{"before": k, "after": k + 1, "chi2": 3.0, "dof": 2, "p_value": 0.2, "same_recording": False}
              for k in (0, 1)],
    "parameters": [{"name": n, "axis": "y", "unit": "ug", "calibrations": [0, 1, 2], "values": [1.0, 2.0, 300.0],
                    "sigmas": [1.0, 1.0, 1.0], "jumps": [2], "outliers": [], "due": "2027-01-01", "scatter": 0.0,
                    "drift_per_year": 3.0, "drift_sigma": 1.0} for n in ("bias", "scale_factor")],
}  # fmt: skip


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[list[object]], str]:
    if CHROMIUM is None:
        pytest.skip("no Chromium here")
    folder = tmp_path_factory.mktemp("pages")
    frames = ""
    for name, text in pages().items():
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
        frames += "".join(f'<iframe data-page="{name}" data-width="{w}" style="width:{w}px;height:800px" '
                          f'src="{name}.html"></iframe>' for w in WIDTHS)  # fmt: skip
    (folder / "asked.html").write_text(ASK.format(frames=frames), encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", "--dump-dom",
               "--enable-logging=stderr", "--virtual-time-budget=30000"]  # fmt: skip
    ran = subprocess.run([CHROMIUM, *options, f"file://{folder / 'asked.html'}"], capture_output=True, text=True,
                         timeout=120, check=False)  # fmt: skip
    found = re.findall(r"@@(\[.*?\])@@", ran.stdout, re.DOTALL)
    assert found, ran.stderr[-2000:]
    return json.loads(unescape(found[-1])), ran.stderr


def test_no_page_is_wider_than_its_window(asked: tuple[list[list[object]], str]) -> None:
    told, _ = asked
    assert len(told) == 3 * len(pages())
    assert [row for row in told if row[2]] == []


def test_charts_are_there_and_open_large(asked: tuple[list[list[object]], str]) -> None:
    for page, width, _, charts, opened, _ in asked[0]:
        assert int(str(charts)) >= 1, page
        assert opened == 1, (page, width)


def test_no_page_complains(asked: tuple[list[list[object]], str]) -> None:
    assert [line for line in asked[1].splitlines() if "CONSOLE" in line] == []
