"""Every kind of page in a real browser at the width of a phone, a tablet and a desk: none wider, no complaint.

Skipped where no Chromium is. One start serves all pages: they stand in frames of these widths and tell their own.
"""

import json
import re
import shutil
import subprocess
from html import unescape

import pytest

from tests.report.pages import PAGES, page

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
WIDTHS = (390, 800, 1400)

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
    page.querySelector("dialog")?.close();
    const beyond = root.scrollWidth - root.clientWidth;
    const cut = [...page.querySelectorAll("figure svg text")].filter((t) => {{
      const box = t.getBoundingClientRect(), whole = t.ownerSVGElement.getBoundingClientRect();
      return box.left < whole.left - 1 || box.right > whole.right + 1 || box.bottom > whole.bottom + 1;
    }}).map((t) => t.textContent);
    const hidden = [...page.querySelectorAll("section.first .scroll")].filter((e) => e.scrollWidth > e.clientWidth + 1);
    const narrow = [...page.querySelectorAll("td, th")].filter((e) => {{
      const box = e.getBoundingClientRect();
      return box.width > 0 && box.height > 12 * Math.max(box.width, 40);
    }}).map((e) => e.textContent.slice(0, 40));
    const words = page.querySelector("main").cloneNode(true);
    words.querySelectorAll("code, pre, details").forEach((e) => e.remove());
    return {{page: f.dataset.page, width: +f.dataset.width, beyond, charts: +root.dataset.charts, opened,
            wide: wide.slice(0, 3), cut: cut.slice(0, 5), hidden: hidden.length, narrow, text: words.textContent}};
  }});
  document.body.textContent = "@@" + JSON.stringify(told) + "@@";
}});</script>"""


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no Chromium here")
    folder = tmp_path_factory.mktemp("pages")
    frames = ""
    for name in PAGES:
        (folder / f"{name}.html").write_text(page(name), encoding="utf-8")
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


def test_no_page_is_wider_than_its_window(asked):
    told, _ = asked
    assert len(told) == 3 * len(PAGES)
    assert [row for row in told if row["beyond"]] == []


def test_charts_are_there_and_open_large(asked):
    for row in asked[0]:
        assert row["charts"] >= 1, row["page"]
        assert row["opened"] == 1, (row["page"], row["width"])


def test_no_word_of_a_chart_is_cut(asked):
    assert {(row["page"], *row["cut"]) for row in asked[0] if row["cut"]} == set()


def test_the_table_of_the_first_screen_fits_a_phone(asked):
    assert [(row["page"], row["width"]) for row in asked[0] if row["hidden"]] == []


def test_no_sentence_of_a_table_is_a_word_wide(asked):
    assert [(row["page"], row["width"], row["narrow"]) for row in asked[0] if row["narrow"]] == []


def test_a_page_is_in_words(asked):
    """No LaTeX, no label such as `bias:x`, no number such as 1e-05, no unit as a program writes it."""
    words = r"\\[a-z]{2,}|[_^]\{|\b[a-z]+(?:_[a-z]+)*:[xyz]\b|\bug\b|\^[23]|sqrt\(|\bdeg/|\bnan\b"
    odd = words + r"|\d(?:\.\d+)?e[+-]?\d+\b| \+- "
    found = {(row["page"], *re.findall(odd, row["text"])[:4]) for row in asked[0] if re.search(odd, row["text"])}
    assert found == set()


def test_no_page_complains(asked):
    assert [line for line in asked[1].splitlines() if "CONSOLE" in line] == []
