"""How idle threads of OpenMP wait: those of torch, which the native library shares.

A fit has thousands of loops a second that take less than a millisecond. To wake a thread that sleeps takes as
long as many of them, above all on virtual machines; one that spins on takes a core that others need. So they
spin for some tens of microseconds and then sleep. docs/accuracy.md says what that is worth.
"""

import os

POLICY = {
    "OMP_WAIT_POLICY": "passive",  # of every OpenMP: sleep
    "GOMP_SPINCOUNT": "1000",  # of GCC's, which torch has on Linux: look so often before that
}


def waiting() -> dict[str, str]:
    """Environment variables that OpenMP reads when torch is imported; what the user has set stays."""
    own = {name: os.environ[name] for name in POLICY if name in os.environ}
    return own or dict(POLICY)
