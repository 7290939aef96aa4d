"""Which nodes of a hierarchy are worth a test of their box (Gu, He and Blelloch, Ray Specialized Contraction
on Bounding Volume Hierarchies, 2015).

A tree of two children a node has many boxes that fill most of the box around them: who meets the one meets
the other. Testing such a node costs more than to go straight to its children, which then hang from the node
above it. The lists of `layout.py` have no fixed number of children, so leaving nodes out changes nothing
else; what rays meet stays the same.
"""

from __future__ import annotations

import numpy as np

from tracer.acceleration.build import Hierarchy

WORTH = 0.5
"""A node is kept where a ray that meets the box above meets its own with a smaller probability than this. The
test costs 1 and with this probability those of two children follow, against 2 without it. Measured with rays
that leave the surface, 0.5 to 0.6 are best."""


def worth_testing(tree: Hierarchy) -> np.ndarray:
    """Mask (n,) of nodes: the root, the leaves, and whatever is small against the nearest kept node above.

    The probability is the ratio of surface areas, as when the tree is cut.
    """
    x, y, z = (tree.upper.astype(np.float64) - tree.lower).T
    area = x * y + y * z + z * x  # from here on that of the nearest kept node, its own box included
    kept = np.ones(len(tree.left), bool)
    for nodes, below in tree.families():
        above = np.repeat(area[nodes], 2)
        left_out = (tree.left[below] != 0) & (area[below] > WORTH * above)
        kept[below] = ~left_out
        area[below] = np.where(left_out, above, area[below])
    return kept
