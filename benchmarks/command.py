"""The command line of a benchmark whose words are the arguments of its `main`."""

import inspect
import sys
from collections.abc import Callable
from importlib import import_module


def call(main: Callable[..., None], code: str = "") -> None:
    """Give it the words of the command line; on --help, or where they do not fit, print its module's text.

    Files of results that it writes are entered in the index, as measures of `code`.
    """
    words, text = sys.argv[1:], sys.modules[main.__module__].__doc__
    if not {"-h", "--help"}.isdisjoint(words):
        print(text)
        return
    try:
        inspect.signature(main).bind(*words)
    except TypeError as error:
        print(f"{text}\nexpected other words: {error}", file=sys.stderr)
        sys.exit(2)
    main(*words)
    results = import_module("benchmarks.results")  # by its name: it is no part of what was measured
    for word in words if code else ():
        results.note(word, code)
