"""Who is who over the whole recording: tracks cut, pieces joined, and why."""
