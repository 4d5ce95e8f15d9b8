"""A bar of how much of a log has been read."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def progress_bar(path: Path, *, shown: bool) -> Iterator[Callable[[int], None] | None]:
    """Give what is told how many bytes have been read, or None if no bar is shown."""
    if not shown or not path.is_file():
        yield None
        return
    from tqdm import tqdm

    with tqdm(total=path.stat().st_size, unit="B", unit_scale=True, leave=False) as bar:

        def update(read_bytes: int) -> None:
            bar.update(read_bytes - bar.n)

        yield update
