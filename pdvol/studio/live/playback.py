"""Which step a live page shows: the newest one, one after the other at the shot's speed, or one that was chosen."""

from dataclasses import dataclass


@dataclass
class Playback:
    """The moment on the screen.

    Attributes
    ----------
    step : the step to show
    follows : whether the newest state is shown as it is stored
    plays : whether steps follow each other at the shot's speed, from the first again after the last
    """

    step: int = 0
    follows: bool = True
    plays: bool = False
    _since: float = 0.0  # moment at which `step` was shown first [s]

    def restart(self) -> None:
        """A new run began: show it as it is computed."""
        self.step, self.follows, self.plays = 0, True, False

    def choose(self, step: int) -> None:
        """Show this step and stay there."""
        self.step, self.follows, self.plays = max(0, step), False, False

    def play(self, now: float, newest: int) -> None:
        """Play from the present step on; from the first one where the present one is the last."""
        if self.step >= newest:
            self.step = 0
        self.follows, self.plays, self._since = False, True, now

    def advance(self, now: float, newest: int, ended: bool, dt: float) -> int:
        """The step to show now.

        Parameters
        ----------
        now : on a clock [s]
        newest : the last stored step
        ended : whether no further step will come: playing then begins again
        dt : the shot's time step [s]
        """
        if self.follows:
            self.step = newest
            if ended:
                self.follows, self.plays, self._since = False, True, now
        elif self.plays and newest > 0:
            passed = int((now - self._since) / dt)
            if passed > 0:
                self._since += passed * dt
                after = self.step + passed
                if after <= newest:
                    self.step = after
                elif self.step < newest or not ended:
                    self.step = newest  # the last one is shown, and a state that is not stored yet is waited for
                else:
                    self.step = 0
        self.step = min(self.step, max(0, newest))
        return self.step
