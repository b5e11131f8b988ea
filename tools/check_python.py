"""Stop with a sentence unless this Python can run texgs. Runs on any Python 3."""

import sys

if not (3, 11) <= sys.version_info[:2] <= (3, 14):
    version = "%d.%d" % sys.version_info[:2]  # noqa: UP031, older Pythons must parse this file
    sys.exit("texgs needs Python 3.11 to 3.14, got %s; run make PYTHON=/path/to/python3.12" % version)  # noqa: UP031
