"""The leg in PyBullet, the second engine."""
