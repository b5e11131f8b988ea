"""A fixture for folders of tests with small images."""

import pytest
import torch


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """Images of a thousand pixels are not worth a second thread; results are the same with any number."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
