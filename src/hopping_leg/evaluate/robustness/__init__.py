"""How far a controller's world may differ from the one it believes in before it fails."""
