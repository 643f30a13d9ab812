"""A detector that somebody brings as an ONNX file, run by OpenCV on the cameras' pictures."""
