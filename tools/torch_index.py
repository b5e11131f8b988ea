"""Print the pip option that makes torch a CPU build on a Linux machine without an NVIDIA GPU; else nothing.

PyPI's torch for Linux brings gigabytes of CUDA libraries. PyTorch's own index has the same version without
them, and pip prefers it (2.13.0+cpu sorts above 2.13.0). Where that index cannot be reached, pip takes what
its own configuration offers.
"""

import shutil
import sys
from urllib.error import URLError
from urllib.request import Request, urlopen

CPU_INDEX = "https://download.pytorch.org/whl/cpu"


def is_reachable(index: str) -> bool:
    """Whether the index answers within five seconds."""
    try:
        with urlopen(Request(f"{index}/torch/", method="HEAD"), timeout=5):
            return True
    except (URLError, OSError):
        return False


if __name__ == "__main__":
    has_gpu = shutil.which("nvidia-smi") is not None
    if sys.platform == "linux" and not has_gpu and is_reachable(CPU_INDEX):
        print(f"--extra-index-url={CPU_INDEX}")
