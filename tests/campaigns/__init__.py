"""Long campaigns, run by hand: the count is the argument. Kernels and threads are those of a run."""

import os

from aatri.pipeline.methods.kernel_cache import use_kernel_cache

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
use_kernel_cache()
