"""Who is tracked in the 3D scene: the run's people, what it is held against, other versions."""
