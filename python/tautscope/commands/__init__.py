"""The verbs of the command line, and what they share: options, printing, progress."""

import os

# On vectors of this size the threads of a BLAS wait for each other longer than they compute.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
