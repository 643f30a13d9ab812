"""What a study is: its definition, what may be sought, what is varied and where it counts."""
