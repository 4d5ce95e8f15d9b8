"""An image of the scene on request: what a camera there would have taken. Needs OpenCV (extra `video`)."""

from vsensor.image.config import ImageConfig
from vsensor.image.render import Image, import_opencv, render

__all__ = ["Image", "ImageConfig", "import_opencv", "render"]
