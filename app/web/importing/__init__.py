"""The routes of opening and importing, and what they tell."""
