"""A whole run of the comparison as a page to look at, as JSON, and as a few lines of Markdown."""

from reference.report.header import header_of
from reference.report.markdown import headline_place, rewrite_headline, summary_markdown
from reference.report.page import write_report
from reference.report.twin import write_json

__all__ = [
    "header_of",
    "headline_place",
    "rewrite_headline",
    "summary_markdown",
    "write_json",
    "write_report",
]
