"""One BLAS thread a process: the tests run in parallel processes, whose BLAS threads would only wait for each other."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
