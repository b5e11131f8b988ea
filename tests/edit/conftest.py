from tests.models.networks import vgg
from tests.one_thread import one_thread

__all__ = ["one_thread", "vgg"]
