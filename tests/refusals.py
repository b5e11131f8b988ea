"""What every refusal is: an error of texgs whose sentence names what is wrong."""

import pytest

from texgs.core.errors import ArgumentError


def refused(call, named, error=ArgumentError):
    """Require that a call raises an error whose sentence has the words `named`, a regular expression."""
    with pytest.raises(error, match=named):
        call()
