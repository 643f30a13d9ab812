"""The room in the 3D scene: what stands still, the cameras' pictures, and its handles."""
