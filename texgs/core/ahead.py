"""Read ahead: the next item is read in a thread while the one before it is worked on."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Read = TypeVar("Read")


def ahead(read: Callable[[Item], Read], items: Iterable[Item]) -> Iterator[tuple[Item, Read]]:
    """Each item with what `read` makes of it, in order; one more than the last one given is read.

    An error of `read` is raised where its item would come.

    Args:
        read: called in one other thread, one item after the other.
        items: iterated in the caller's thread.
    """
    with ThreadPoolExecutor(1) as pool:
        before: tuple[Item, Future[Read]] | None = None
        for item in items:
            following = item, pool.submit(read, item)
            if before is not None:
                yield before[0], before[1].result()
            before = following
        if before is not None:
            yield before[0], before[1].result()
