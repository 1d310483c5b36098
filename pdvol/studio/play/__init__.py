"""The player: stored runs as one HTML file that opens without a network. Nothing here imports a solver.

`panes.py` says what is shown, `motion.py` and `fields.py` store it in few bytes (`packing.py`), `curves.py` has the
graphs, `document.py` writes the file, and `page/` is what runs in the browser.
"""
