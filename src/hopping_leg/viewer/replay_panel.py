"""Input of a replay: which time is shown."""

import viser

from hopping_leg.viewer.inbox import Inbox, put_value
from hopping_leg.viewer.replay import Replay


class ReplayPanel:
    """A slider for the time, which follows the replay as it plays.

    Args:
        server: Of the page.
        inbox: For what is asked.
        replay: To be steered.
    """

    def __init__(self, server: viser.ViserServer, inbox: Inbox, replay: Replay) -> None:
        self._replay = replay
        self._time = server.gui.add_slider(
            "Time, s", min=0.0, max=replay.length, step=0.01, initial_value=0.0
        )
        self._time.on_update(inbox.from_page(self._seek))
        self._shown = 0.0

    def show(self) -> None:
        """Bring the slider in line with the replay, unless it was the slider that moved it."""
        if self._replay.now != self._shown:
            self._shown = self._replay.now
            put_value(self._time, round(self._shown, 2))

    def _seek(self) -> None:
        self._replay.seek(self._time.value)
        self._shown = self._replay.now
