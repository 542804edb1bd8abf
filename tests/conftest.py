"""Strict by default: floating-point faults raise, and the same examples are drawn on every machine."""

import numpy as np
from hypothesis import settings

np.seterr(all="raise", under="ignore")
# compiling a kernel takes seconds, so a deadline would only measure the first call
settings.register_profile("strict", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("strict")
