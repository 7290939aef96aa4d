"""The pictures of the scenes, drawn by program; `make_wallpapers.py` writes them."""
