"""The live viewer, `tracer view`: a page in the browser whose pictures the renderer makes while one edits.

`Session` holds what is looked at, `Renderer` makes pictures of it in a thread of its own, and the web server
carries both to the page. Neither of the first two knows of a browser.
"""

from __future__ import annotations
