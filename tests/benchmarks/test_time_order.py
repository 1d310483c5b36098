"""The study of integrators: a short shot."""

from benchmarks.time_order import __main__ as study


def test_states_are_those_of_common_times():
    scene = study.cantilever(damping=0.02)
    coarse, fine = (study.states(scene, dt, "bdf2", steps=5)[0] for dt in (study.DT, study.DT / 5.0))
    assert len(coarse["x"]) == len(fine["x"]) == 5 and fine["newton"] > coarse["newton"] > 0
    assert 0.0 < study.over_shot(coarse, fine) < 1e-3


def test_bad_words_are_refused(capsys):
    assert study.main(["--parts", "order,speed"]) == 2
    assert capsys.readouterr().err == (
        "benchmarks.time_order: there is no part 'speed'; there are order, swings, shots, levels\n"
    )
