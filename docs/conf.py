"""Configuration of the documentation: ``make docs``."""

from __future__ import annotations

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent), str(DOCS / "_extensions")]

project = "haptic-skill"
author = "The maintainers of haptic-skill"
copyright = author
release = version = installed_version("haptic-skill")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "plain_docstrings",
    "published_tables",
    "source_links",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_extensions", "_templates", "tutorials", "gallery/*.ipynb", "gallery/*.py", "gallery/*.zip"]
templates_path = ["_templates"]
default_role = "code"

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 900  # s, of a cell; a build beside other work is slow

sphinx_gallery_conf = {
    "examples_dirs": "tutorials",
    "gallery_dirs": "gallery",
    "abort_on_example_error": True,
    "capture_repr": ("_repr_html_",),  # not "<Legend object at ...>"
    "remove_config_comments": True,
    "show_memory": False,
    "thumbnail_size": (800, 450),
    "show_signature": False,
    "write_computation_times": False,  # its pages load scripts from other sites
    "within_subsection_order": "FileNameSortKey",
}

autosummary_generate = True
autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}

napoleon_google_docstring = True
napoleon_use_ivar = True  # attributes are described with their class, not once more as members
suppress_warnings = ["ref.python"]  # a name such as Array has a home in `models` and one in `skill`

html_theme = "pydata_sphinx_theme"
html_title = "haptic-skill"
html_theme_options = {
    "header_links_before_dropdown": 7,
    "show_toc_level": 2,
    "use_edit_page_button": False,
}
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
