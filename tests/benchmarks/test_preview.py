"""The study of previews: its page."""

from benchmarks.preview import page, shots


def test_the_page_has_what_the_command_makes():
    text, made = page.DOCS.read_text(), page.Page(page.DOCS, "preview", "table").text
    assert made.count("\n| level") == 8 and all(kind in made for kind in shots.KINDS)
    for name in ("how_right_bar", "how_right_ape"):
        for ending in ("webp", "png"):
            assert f"pictures/{name}.{ending}" in text and (page.PICTURES / f"{name}.{ending}").stat().st_size < 6e6
