"""An external detector from an ONNX file, run by OpenCV on the cameras' images."""
