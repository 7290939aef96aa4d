"""The parts of the command line that need no process: error texts, warnings about scenes, lazy names."""

from __future__ import annotations

import errno
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import tracer
from tracer.cli.failures import explain
from tracer.cli.interruption import Interruption
from tracer.cli.scenes import first_comment
from tracer.errors import MachineError, SceneError
from tracer.scene_warnings import warnings_of

CANVAS = {"camera": {"resolution": [640, 480], "distance": 800.0}}
"""Eye at (0, 0, 800), canvas of 640 x 480 units at z = 0."""


def ball(z: float, x: float = 0.0, radius: float = 5.0) -> dict[str, object]:
    return {"kind": "sphere", "center": [x, 0.0, z], "radius": radius}


@pytest.mark.parametrize(
    ("shape", "hidden"),
    [
        (ball(400), True),
        (ball(-400), False),
        (ball(3), False),  # cuts the canvas
        (ball(5.1), True),
        (ball(797), False),  # cuts the plane of the eye
        (ball(900), False),  # behind the eye
        (ball(400, x=160), True),  # half in the view, whose half width is 160 there
        (ball(400, x=164.9), True),
        (ball(400, x=165.5), False),
        ({"kind": "mesh", "builtin": "cube", "translate": [0, 0, 400]}, True),
        ({"kind": "mesh", "builtin": "cube", "translate": [0, 0, 400], "scale": 500}, False),
        ({"kind": "mesh", "builtin": "cube", "translate": [0, 200, 400]}, False),
        ({"kind": "plane", "coefficients": [0, 0, 1, -400]}, False),
    ],
)
def test_only_shapes_wholly_between_eye_and_canvas_are_named(shape: dict[str, object], hidden: bool) -> None:
    found = warnings_of(tracer.load(CANVAS | {"shapes": [shape]}))
    assert len(found) == hidden
    assert all(text.startswith("scene: `shapes.0` lies wholly between the eye") for text in found)


def test_the_warning_names_shapes_and_stays_short() -> None:
    shapes = [ball(400) | {"name": f"ball {k}"} for k in range(7)]
    shapes.append({"kind": "mesh", "builtin": "cube", "name": "cube"})
    shapes.append({"kind": "instance", "of": "cube", "translate": [0, 0, 300]})
    (text,) = warnings_of(tracer.load(CANVAS | {"shapes": shapes}))
    assert '`shapes."ball 0"`, ' in text and '`shapes."ball 4"` and 3 more lie wholly' in text


@pytest.mark.parametrize(
    ("error", "text", "code"),
    [
        (SceneError("a.toml: wrong"), "a.toml: wrong", 2),
        (MachineError("no GPU"), "no GPU", 3),
        (MemoryError("8 GiB"), "there is not enough memory (8 GiB)", 3),
        (RuntimeError("jit_malloc(): out of memory! Could not"), "there is not enough memory (jit_malloc", 3),
        (OSError(errno.ENOSPC, "No space left on device", "x.png"), "x.png: No space left on device", 2),
        (ZeroDivisionError("x"), "unexpected ZeroDivisionError: x (a fault of tracer itself", 70),
    ],
)
def test_every_error_has_a_sentence_and_a_code(error: Exception, text: str, code: int) -> None:
    sentence, found = explain(error)
    assert sentence.startswith(text)
    assert found == code


def test_a_signal_waits_only_while_deferred() -> None:
    import signal

    with Interruption() as interruption:
        with interruption.deferred():
            signal.raise_signal(signal.SIGINT)
            with pytest.raises(KeyboardInterrupt):
                interruption.check()
        assert (interruption.requested, interruption.exit_code) == (signal.SIGINT, 130)
    with Interruption() as interruption, pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    assert (interruption.reason, interruption.exit_code) == ("terminated", 143)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_the_first_comment_of_a_scene(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    for text, comment in (
        ("\n# What it is.\n# More.\n", "What it is."),
        ("version = 1\n# No.\n", ""),
        ("", ""),
    ):
        file.write_text(text)
        assert first_comment(file) == comment


def test_public_names_come_on_demand_and_without_dr_jit_at_first() -> None:
    assert set(tracer.__all__) <= set(dir(tracer))
    assert all(getattr(tracer, name) is not None for name in tracer.__all__)
    with pytest.raises(AttributeError, match="module 'tracer' has no attribute 'nothing'"):
        tracer.nothing  # type: ignore[attr-defined]  # noqa: B018
    code = "import tracer, sys; print([m for m in ('drjit', 'numpy', 'pydantic') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_render_is_the_function_even_after_the_module_was_imported() -> None:
    code = "import tracer.render, tracer.queries, tracer; print(type(tracer.render).__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "function\n"
    assert isinstance(sys.modules["tracer"], ModuleType)
