"""The engine: multi-view tracking of several people in 3D, usable without the workbench."""

__version__ = "0.1.0"
