"""Who may speak to the viewer: pages that it served itself, on this machine, or those who know a token."""

from __future__ import annotations

import ipaddress
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import urlsplit

COOKIE = "tracer-viewer"

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; object-src 'none'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
"""Of every answer: nothing is loaded from elsewhere, and no other page may embed this one."""


def is_loopback(host: str) -> bool:
    """Whether an address or a name means this machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


@dataclass
class Guard:
    """Checks requests. Bound to the loopback address, a request must name it (so that no other site's name
    can be made to lead here); bound to another one it must bring the cookie that the token was exchanged
    for, and the token serves once. A page of another origin is always refused."""

    loopback: bool
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    _cookie: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    _spent: bool = False

    def exchange(self, token: str) -> str | None:
        """The cookie for the token, once; None for a wrong or spent one."""
        if self._spent or not secrets.compare_digest(token.encode(), self.token.encode()):
            return None
        self._spent = True
        return self._cookie

    def objection(self, headers: Mapping[str, str], cookie: str | None) -> str | None:
        """Why a request is refused; None where it is not."""
        host = headers.get("host", "")
        if self.loopback:
            if not is_loopback(urlsplit(f"//{host}").hostname or ""):
                return f"the host {host[:100]!r} is not this machine"
        elif cookie is None or not secrets.compare_digest(cookie.encode(), self._cookie.encode()):
            return "the token is missing or was used already; start the viewer again for a new one"
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            return f"the origin {origin[:100]!r} is another page"
        return None
