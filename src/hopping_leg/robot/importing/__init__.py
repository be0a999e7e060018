"""A leg that somebody described as URDF or MJCF, read into this package's planar robot."""
