"""The engine: multi-view tracking of several people in 3D, usable without the workbench."""

import os

# read when OpenCV is loaded, by whichever module is the first: a picture says its size before it
# is decoded, and 67 million pixels take 200 MB
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(2**26))

__version__ = "0.1.0"
