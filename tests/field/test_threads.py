"""A pass over logs in threads: the sums of one thread, all rows told, and one end for all."""

import threading
import time

import numpy as np
import pytest

from vsensor.errors import TableError
from vsensor.field.tune.spread import threads


class Adding:
    """Adds the files, here numbers; `bad` is one that cannot be read. Remembers who worked."""

    def __init__(self, bad=None):
        self.bad, self.names = bad, set()

    def start(self):
        return np.zeros(8, np.int64)

    def add(self, sums, file, progress=None):
        self.names.add(threading.get_ident())
        for _ in range(5):
            time.sleep(1e-3)  # so that no thread does all
            if progress is not None:
                progress(2)
        if file == self.bad:
            raise TableError(f"{file}: cannot be read")
        sums[file % 8] += file


@pytest.mark.parametrize("count", [1, 2, 5, 100])
def test_the_sums_and_the_rows_told_do_not_depend_on_the_threads(count):
    told, work = [], Adding()
    found = threads(told.append, count)(work, range(21))
    np.testing.assert_array_equal(found, [sum(range(k, 21, 8)) for k in range(8)])
    assert told == [2] * 5 * 21
    assert (len(work.names) > 1) == (count > 1)


def test_what_one_thread_raises_is_raised_and_ends_the_others():
    told = []
    with pytest.raises(TableError, match="3: cannot be read"):
        threads(told.append, 4)(Adding(bad=3), range(4000))
    assert len(told) < 2000


def test_ctrl_c_ends_all_threads_with_their_chunk():
    told = []

    def pressed(rows):
        told.append(rows)
        if len(told) == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        threads(pressed, 4)(Adding(), range(4000))
    assert len(told) < 2000
