"""Many targets in the plane, which every filter of the field can be fed."""
