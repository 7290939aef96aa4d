"""The bounding volume hierarchy over all triangles of a scene, and what happens close to a ray's start."""
