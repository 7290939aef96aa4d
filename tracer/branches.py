"""Work for some lanes, which packets without such a lane skip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr


def changed_where(lanes: Any, value: Any, change: Callable[[Any], Any], label: str) -> Any:
    """change(value) in some lanes, the value in others."""
    (result,) = dr.if_stmt(
        args=(value,),
        cond=lanes,
        true_fn=lambda value: (change(value),),
        false_fn=lambda value: (value,),
        label=label,
    )
    return result
