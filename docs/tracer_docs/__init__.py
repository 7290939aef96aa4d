"""What the documentation site computes while it is built; one Sphinx extension a file."""
