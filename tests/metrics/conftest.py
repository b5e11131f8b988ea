from tests.models.networks import vgg

__all__ = ["vgg"]
