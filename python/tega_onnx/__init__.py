"""Use ONNX models as a metric and as a decoder, in threads of their own."""
