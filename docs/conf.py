"""How Sphinx builds the documentation: `make docs`."""

import hashlib
import sys
from pathlib import Path

import triboflux

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

project = "triboflux"
author = "The triboflux developers"
copyright = author
release = version = triboflux.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "_extensions.docstrings",
    "_extensions.generated",
    "_extensions.mathml",
    "_extensions.notebooks",
    "_extensions.offline",
]
exclude_patterns = ["_*"]

# Markdown that a code host shows, too: headings make their own anchors, as they do there.
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

# Notebooks run in full. What neither they nor the package changed since is taken from the cache.
SOURCE = sorted(Path(triboflux.__file__).parent.rglob("*.py"))
STATE = hashlib.sha256(b"".join(path.read_bytes() for path in SOURCE)).hexdigest()[:16]
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE.parent / "build" / "notebooks" / STATE)
nb_execution_timeout = 600  # for a cell, on a busy machine
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_ipywidgets_js = {}  # would come from another host

# Names of this package have to resolve; those of others would need their sites.
nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(?!triboflux).*")]

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True, "exclude-members": "model_config"}
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
# Single backticks in docstrings are names.
default_role = "code"

# Quotation marks are those of the pages; Sphinx itself puts two hyphens between type and meaning.
smartquotes_action = "D"

html_theme = "furo"
html_title = f"triboflux {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
pygments_dark_style = "github-dark"
html_show_sphinx = False
html_copy_source = False

# `make links` asks the network; `make docs` does not.
linkcheck_timeout = 20
linkcheck_retries = 2
