"""What a study has found: which parameters matter, and the values it proposes."""
