"""A teacher that sees the true state, and students that learn to act like it on measurements."""
