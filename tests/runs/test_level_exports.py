"""When `level_N.xdmf` follows a running level."""

from collections import Counter

import pytest

from cli_scenes import FALL, pdvol, write
from pdvol.runs.shared_writer import Export


@pytest.mark.parametrize(("pause", "at_each_step"), [(20.0, False), (0.0, True)])
def test_short_levels_are_exported_at_their_end_alone(tmp_path, monkeypatch, pause, at_each_step):
    counts, export = Counter(), Export.write
    monkeypatch.setattr("pdvol.runs.shared_writer.EXPORT_PAUSE", pause)
    monkeypatch.setattr("pdvol.runs.shared_writer.EXPORT_SHARE", float("inf"))
    monkeypatch.setattr(Export, "write", lambda self, level: counts.update([level]) or export(self, level))
    assert pdvol("run", write(tmp_path / "fall.py", FALL), "--steps", 3, "--out", tmp_path / "run") == 0
    assert all((tmp_path / "run" / f"level_{level}.xdmf").is_file() for level in (0, 1))
    assert counts == dict.fromkeys((0, 1), 5 if at_each_step else 1)
