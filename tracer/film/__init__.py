"""The film: what a render leaves behind, and the files that it is written to (document, sections 8 and 9)."""
