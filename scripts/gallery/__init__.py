"""Renders every scene into docs/gallery: `python -m scripts.gallery`, or `make gallery`."""
