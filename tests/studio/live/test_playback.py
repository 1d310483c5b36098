"""Which step is shown when."""

from pdvol.studio.live.playback import Playback

DT = 0.1


def test_the_newest_state_is_followed_and_the_end_is_played():
    playback = Playback()
    assert [playback.advance(t, newest, False, DT) for t, newest in ((0.0, 0), (0.5, 3), (0.6, 5))] == [0, 3, 5]
    assert playback.advance(1.0, 10, True, DT) == 10 and playback.plays
    assert playback.advance(1.05, 10, True, DT) == 10
    assert playback.advance(1.15, 10, True, DT) == 0  # from the first one again
    assert playback.advance(1.45, 10, True, DT) == 3


def test_playing_waits_for_states_that_are_not_stored_yet():
    playback = Playback()
    playback.choose(2)
    playback.play(0.0, 4)
    assert [playback.advance(t, 4, False, DT) for t in (0.15, 0.25, 5.05, 6.05)] == [3, 4, 4, 4]
    assert playback.advance(6.15, 8, False, DT) == 5


def test_a_chosen_step_stays():
    playback = Playback()
    playback.choose(3)
    assert playback.advance(9.0, 7, True, DT) == 3 and not playback.plays
    playback.choose(-2)
    assert playback.advance(9.0, 7, True, DT) == 0
    playback.choose(9)
    assert playback.advance(9.0, 7, False, DT) == 7


def test_playing_from_the_last_state_starts_at_the_first():
    playback = Playback()
    playback.choose(7)
    playback.play(1.0, 7)
    assert playback.advance(1.0, 7, True, DT) == 0
    playback.restart()
    assert playback.follows and playback.step == 0
