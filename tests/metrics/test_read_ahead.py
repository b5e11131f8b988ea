"""Reading ahead: order, errors, and how far."""

import threading

import pytest

from texgs.metrics.quality import read_ahead


def test_items_come_in_order_with_what_is_read_of_them():
    assert list(read_ahead(str, range(5))) == [(index, str(index)) for index in range(5)]
    assert list(read_ahead(str, [])) == []


def test_the_next_one_is_read_meanwhile_and_no_other():
    begun = [threading.Event() for _ in range(4)]

    def read(index):
        begun[index].set()
        return index

    for index, _ in read_ahead(read, range(4)):
        assert index == 3 or begun[index + 1].wait(10)
        assert not any(event.is_set() for event in begun[index + 2 :])


def test_an_error_comes_in_its_place():
    items = read_ahead(lambda x: 1 / x, [1, 2, 0, 4])
    assert [next(items), next(items)] == [(1, 1), (2, 0.5)]
    with pytest.raises(ZeroDivisionError):
        next(items)
