"""The gallery: each demo's film, picture, table of levels and checked claim, made from a stored run by one command.

    ./run python -m demos.gallery ball_on_spike

See `entries.py` for what is shown, `docs/gallery/` for the pages.
"""
