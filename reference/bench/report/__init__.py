"""A run of the benchmark as a page to look at, as Markdown, and as a few lines for a terminal."""

from reference.bench.report.markdown import summary_of
from reference.bench.report.page import page_of
from reference.bench.report.text import table_of

__all__ = ["page_of", "summary_of", "table_of"]
