"""Some pictures of a video, evenly spread over it, however long it turns out to be."""

from vsensor.video.types import Picture

FEWEST = 6


class Spread:
    """Keeps every n-th picture; n doubles whenever there are twice as many as wanted."""

    def __init__(self, fewest: int = FEWEST) -> None:
        """Keep `fewest` to twice as many pictures, or all of a short video."""
        self._fewest, self._every, self._seen = fewest, 1, 0
        self._kept: list[Picture] = []

    def offer(self, picture: Picture) -> None:
        """Take the next picture of the video, or leave it."""
        if self._seen % self._every == 0:
            self._kept.append(picture)
        self._seen += 1
        if len(self._kept) >= 2 * self._fewest:
            self._kept, self._every = self._kept[::2], 2 * self._every

    def pictures(self) -> tuple[Picture, ...]:
        """Return what was kept, in order."""
        return tuple(self._kept)
