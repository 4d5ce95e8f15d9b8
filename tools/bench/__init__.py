"""The project's figures, measured in one run: `make bench`, `python -m tools.bench`.

Times on a shared machine mean little alone. So each stands as a ratio beside something else that was
measured in the same run, in turns with it, and medians count. One thread: numpy's BLAS is told so
before numpy is imported.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
