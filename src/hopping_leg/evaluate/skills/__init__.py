"""What else the leg can do: hop so many times and stop, hop once, land softly, climb steps."""
