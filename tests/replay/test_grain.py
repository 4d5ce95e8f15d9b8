"""How much is read at a time: small pieces where frames leave no pause, as a frame waits for a large one."""

import numpy as np

from tests.replay.playing import EVERYTHING, MS, Bus, play, write_log
from vsensor.clock import SimulatedClock
from vsensor.replay.chores import Chore
from vsensor.replay.player import Player
from vsensor.replay.reading import survey
from vsensor.replay.reel import PIECE, Reel
from vsensor.replay.supply import FINEST


class Dear(Reel):
    """A reel of which a pull takes 40 us, and 5 us for each frame."""

    def __init__(self, path, clock):
        super().__init__(path, survey(path), choice=EVERYTHING)
        self.clock, self.grains = clock, []

    def pull(self):
        piece = super().pull()
        if piece is not None:
            self.grains.append(len(piece.frames))
            cost_ns = 40_000 + 5_000 * len(piece.frames)
            self.clock.sleep_until_ns(self.clock.now_ns() + cost_ns)
        return piece


def played(path):
    """Play a log; returns its reel, and the lateness of its frames in ms."""
    clock = SimulatedClock()
    reel = Dear(path, clock)
    player = Player(reel, Bus(clock), clock)
    report = play(player)
    assert report.reordered == 0
    return reel, np.array(list(report.timing.lateness)) / MS


def test_on_a_bus_without_pauses_pieces_get_so_small_that_hardly_a_frame_waits_for_one(tmp_path):
    every_ms = 0.2  # a piece of 128 takes 0.68 ms, one of 16 takes 0.12
    path = write_log(tmp_path / "full.log", np.arange(4000) * every_ms, ids=[1] * 4000)
    reel, late_ms = played(path)
    assert reel.grain == FINEST
    assert np.count_nonzero(late_ms > 0.001) <= 8  # once, before it is known what a pull takes
    assert late_ms.max() <= 1.0


def test_where_there_are_pauses_again_pieces_get_large_again(tmp_path):
    dense, sparse = np.arange(2000) * 0.2, 400 + np.arange(1, 6000) * 4.0
    path = write_log(tmp_path / "both.log", [*dense, *sparse], ids=[1] * 7999)
    reel, late_ms = played(path)
    assert min(reel.grains[:-1]) <= FINEST + 8  # lines of text differ in length
    assert reel.grain == PIECE
    assert np.count_nonzero(late_ms > 0.001) <= 8


def test_what_a_work_took_once_is_forgotten_where_it_never_fits():
    chore = Chore(lambda: None)
    chore.took(1_000_000)
    refused = 0
    while not chore.fits(100_000):
        refused += 1
    assert 100 <= refused <= 250
