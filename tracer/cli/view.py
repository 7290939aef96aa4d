"""`tracer view`: the live viewer, a page in the browser."""

from __future__ import annotations

import importlib.util
import logging
import sys
import webbrowser
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tracer.cli.failures import talk
from tracer.cli.options import LARGEST_SIDE, backend_option, scene_options, threads_option
from tracer.cli.questions import QUESTIONS
from tracer.errors import MachineError, UsageError

if TYPE_CHECKING:
    from tracer.scene import Scene
    from tracer.viewer.state import Source

USUAL_PORT = 8433


@click.command(short_help="Look at a scene, turn it and edit it, live in the browser.")
@click.argument("scene", metavar="SCENE")
@click.option(
    "--resolution",
    type=click.IntRange(1, LARGEST_SIDE),
    nargs=2,
    metavar="W H",
    help="Size of view, stills and saved scenes; the vertical extent of the canvas stays.",
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    metavar="ADDRESS",
    help="Address to listen at. Any other than the loopback address lets others in, with a one-time token.",
)
@click.option(
    "--port",
    type=click.IntRange(1, 65535),
    metavar="N",
    help=f"Port to listen at.  [default: {USUAL_PORT}, or a free one where that is taken]",
)
@click.option("--browser/--no-browser", default=None, help="Open the page.  [default: at a terminal]")
@backend_option("Processor.")
@threads_option
@scene_options
def view(
    scene: str,
    resolution: tuple[int, int] | None,
    host: str,
    port: int | None,
    browser: bool | None,
    backend: str,
    threads: int | None,
    overrides: tuple[str, ...],
    allow_outside: bool,
) -> int:
    """Look at SCENE, a .toml file or a built-in name, in the browser; Ctrl-C ends it.

    The page shows the scene as the renderer makes it while one turns the camera and moves sliders: smaller
    pictures while something moves, the full one with all its rays at rest. A click shows the tree of rays of
    a pixel. The document's room has switches for the six questions of `tracer classic`.

    Scenes and stills are saved as NAME-view-1.toml, .png and .exr in the scene's folder, those of a built-in
    name in the working directory; a saved scene renders the same bytes as the still of its name.

    \b
    Examples:
      tracer view classic
      tracer view my.toml --resolution 640 480
      tracer view classic --host 0.0.0.0
    """
    from tracer.doctor import VIEWER_LIBRARIES

    missing = [name for name in VIEWER_LIBRARIES if importlib.util.find_spec(name) is None]
    if missing:
        raise MachineError(
            f"the viewer needs {' and '.join(missing)}, not installed here; "
            "`pip install whitted-tracer[viewer]` installs what it needs"
        )
    from tracer.backends import find_backend
    from tracer.viewer import server
    from tracer.viewer.hub import Hub
    from tracer.viewer.safety import Guard, is_loopback
    from tracer.viewer.saving import Folder
    from tracer.viewer.session import Session

    find_backend(backend)
    session = Session(_source(scene, overrides, allow_outside, resolution))
    folder = Folder(_folder(scene), session.name)
    try:
        listening = server.listen(host, port, USUAL_PORT)
    except OSError as error:
        where = host if port is None else f"{host}, port {port}"
        raise UsageError(f"{where}: cannot listen there: {error.strerror or error}") from error
    guard = Guard(is_loopback(host))
    logging.getLogger("tracer.viewer").addHandler(_Talk())
    url = f"http://{f'[{host}]' if ':' in host else host}:{listening.getsockname()[1]}/"
    if not guard.loopback:
        talk(
            f"warning: {host} can be reached by others, who may change and save this scene once they are in; "
            "the token below lets one browser in"
        )
        url += f"?token={guard.token}"
    click.echo(url)
    if sys.stdout.isatty() if browser is None else browser:
        webbrowser.open(url)
    try:
        server.run(lambda: Hub(session, folder, backend, threads), guard, listening)
    except KeyboardInterrupt:
        pass
    return 0


class _Talk(logging.Handler):
    """The viewer's log on stderr, in the form of all other talk."""

    def emit(self, record: logging.LogRecord) -> None:
        """One line."""
        talk(record.getMessage())


def _folder(scene: str) -> Path:
    """Where scenes and stills go."""
    return Path(scene).parent if Path(scene).is_file() else Path.cwd()


def _source(
    name: str, overrides: tuple[str, ...], allow_outside: bool, resolution: tuple[int, int] | None
) -> Source:
    """How the scene is loaded; the document's room with its six choices."""
    from tracer.assets import builtin_scenes
    from tracer.cli.classic_room import load_room
    from tracer.scene import find_scene, load
    from tracer.viewer.state import Source

    path, _ = find_scene(name)
    if path.resolve() != builtin_scenes()["classic"].resolve():
        return Source(lambda _: _resized(load(path, None, allow_outside, overrides), resolution))

    @lru_cache(maxsize=64)
    def room(answers: tuple[tuple[str, bool], ...]) -> Scene:
        return _resized(load_room(dict(answers), overrides, allow_outside), resolution)

    return Source(
        lambda choices: room(tuple(choices.items())),
        {question.key: question.default for question in QUESTIONS},
        {question.key: (question.text, *question.answers) for question in QUESTIONS},
    )


def _resized(scene: Scene, resolution: tuple[int, int] | None) -> Scene:
    """The scene at another size; the vertical extent of the canvas stays."""
    from tracer.canvas import Canvas
    from tracer.viewer.camera import on_canvas

    if resolution is not None:
        scene.camera = on_canvas(scene.camera, Canvas.of(scene.camera, scene.literal).resized(*resolution))
    return scene
