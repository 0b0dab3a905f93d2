"""Configuration of the documentation: `make docs`, or sphinx-build -W -b html docs docs/_build/html."""

import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent / "src")]

project = "passiflex"
author = "the passiflex authors"
exclude_patterns = ["_build", "generated"]

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "mathml",
    "scenario_tables",
    "measures_table",
    "robots_table",
    "docstrings",
    "made_figures",
    "example_cells",
]
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
default_role = "code"

nb_execution_mode = "force"  # the package may have changed where a notebook has not
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True
os.environ["IPYTHONDIR"] = str(HERE / "_build" / "ipython")  # nobody's settings, and nothing into a home

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 100

html_theme = "furo"
html_title = "passiflex"
html_static_path = ["_static"]
html_css_files = ["equations.css", "pages.css"]
html_math_renderer = "mathml"
html_show_copyright = False
html_copy_source = False
