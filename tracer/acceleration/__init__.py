"""The bounding volume hierarchy over all triangles of a scene, and its brute-force twin."""
