"""How quick the live viewer is at the browser, and what it keeps in memory."""
