"""Configure Sphinx: no internet, every warning an error, every link followed."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT))

sys.path.insert(0, str(DOCS))

import build_commands  # noqa: E402
import build_schemas  # noqa: E402

import gimbalcal  # noqa: E402

project, author = "gimbalcal", "gimbalcal contributors"
copyright = author  # noqa: A001  the name is Sphinx's
version = release = gimbalcal.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx-mathjax-offline"]
exclude_patterns = ["_build", "measured", "*.py"]
nitpicky = True
suppress_warnings = ["misc.highlighting_failure"]  # the output of a command is not shell code
nitpick_ignore_regex = [("py:.*", r".*")]  # types of other packages have no pages here

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4

# Notebooks are run when their text changes, and shown with their output and figures; one that fails ends the build.
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
nb_execution_mode = "cache"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
os.environ.pop("MPLBACKEND", None)  # figures go into the page

autodoc_typehints = "none"  # shapes and units are in the descriptions
autodoc_member_order = "bysource"

html_theme = "furo"
html_title = f"gimbalcal {release}"
html_static_path = ["_static"]
html_css_files = ["page.css"]
html_show_sphinx = False
html_copy_source = False
html_theme_options = {"light_css_variables": {"color-brand-primary": "#0072B2", "color-brand-content": "#0072B2"}}

NOTEBOOKS = ROOT / "notebooks"
OUTSIDE = re.compile(r"\[([^\]]+)\]\((\.\./(?:\.\./)*[^)#\s]+)(?:#[^)]*)?\)")


WRITTEN = {"commands": lambda: f"{build_commands.page()}\n{build_schemas.page()}"}  # pages that are written here


def _files_of_the_project(_app: Any, name: str, source: list[str]) -> None:
    """Replace a link to a file of the project that is not a page by its words; the file has to exist."""

    def named(found: re.Match[str]) -> str:
        words, path = found[1], (DOCS / name).parent / found[2]
        if path.resolve().is_relative_to(DOCS):
            return found[0]
        if path.resolve().is_relative_to(NOTEBOOKS):
            return found[0].replace("../notebooks/", "notebooks/")
        if not path.exists():
            raise FileNotFoundError(f"docs/{name}.md links to {found[2]}, which is not there")
        return words

    if name in WRITTEN:
        source[0] = WRITTEN[name]()
    source[0] = OUTSIDE.sub(named, source[0])


def setup(app: Any) -> None:
    """Register the handler of sources, and take the notebooks into the pages; called by Sphinx."""
    shutil.rmtree(DOCS / "notebooks", ignore_errors=True)
    shutil.copytree(NOTEBOOKS, DOCS / "notebooks", ignore=shutil.ignore_patterns("__pycache__"))
    app.connect("source-read", _files_of_the_project)
