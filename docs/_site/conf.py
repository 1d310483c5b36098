"""Sphinx's settings for `./run docs`: Markdown pages by MyST, docstrings by autodoc, equations as MathML.

No file comes from the net.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import pdvol

project = "pdvol"
author = "the pdvol contributors"
release = version = pdvol.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "mathml", "docstrings", "repository_links"]
exclude_patterns = ["_site"]
root_doc = "index"

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3  # pages link to headings by the anchors that code hosts give them

linkcheck_ignore = [r"(\.\./)*source/"]  # pages of repository_links.py, which only the site has

html_theme = "furo"
html_title = "pdvol"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = html_show_copyright = False
html_math_renderer = "mathml"
pygments_style, pygments_dark_style = "friendly", "monokai"

autodoc_typehints = "none"  # units and shapes are in the text; the types beside them are long
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
default_role = "code"
smartquotes = False  # quotes are part of what is typed
highlight_language = "text"  # of blocks without a language: commands and formulas
