"""The browser that tests of pages share hears complaints and requests."""


def test_complaints_and_requests_are_heard(tab, tmp_path):
    (tmp_path / "page.html").write_text(
        "<script>console.error('one'); setTimeout(() => { throw new Error('two'); });</script>"
        "<img src='https://pdvol.invalid/three.png'>"
    )
    tab.open(tmp_path / "page.html")
    said = " ".join(tab.complaints)
    assert "error: one" in said and "exception: two" in said
    assert tab.requests == ["https://pdvol.invalid/three.png"]
