"""The report of a run: nothing of it is lost, failures come first, and empty cases say so."""

from __future__ import annotations

import json
import math
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from reference.comparison.records import Outcome, Panels, Validation
from reference.report import (
    header_of,
    rewrite_headline,
    summary_markdown,
    write_json,
    write_report,
)
from reference.report.bounds import failures_first, used
from reference.report.headline import Headline
from reference.report.markdown import BEGIN, END
from reference.report.matrix import matrix, shade
from reference.report.numbers import number, percent, unit
from reference.report.pictures import trio_of
from reference.report.summary import term_rows
from reference.tolerances import TOLERANCES
from tests.outcomes import COMMAND, chains, distances, failing_run, hits, picture, run_of
from tracer.errors import OutputError, UsageError


class Page(HTMLParser):
    """Text, ids and loaded addresses of a page, and the elements that were never closed."""

    VOID = ("meta", "link", "img", "br", "input")

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.loads: list[str] = []
        self.open: list[str] = []
        self.words = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.ids += [given["id"] or ""] if "id" in given else []
        address = given.get("href") or ""
        (self.links if tag in ("a", "use") else self.loads).append(address)
        self.loads += [given[name] or "" for name in ("src", "srcset", "data", "poster") if name in given]
        assert not [name for name in given if name.startswith("on")], "an inline event handler"
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data


def written(folder: Path, validation: Validation) -> Page:
    write_report(folder / "index.html", validation)
    return Page(folder / "index.html")


def test_the_json_file_holds_every_number_but_pictures(tmp_path: Path) -> None:
    run = failing_run()
    write_json(tmp_path / "index.json", run)
    table = json.loads((tmp_path / "index.json").read_text(encoding="utf-8"))
    assert table["header"] == run.header and table["notes"] == list(run.notes) and table["passed"] is False
    assert table["tolerances"] == [{"name": name, **row._asdict()} for name, row in TOLERANCES.items()]
    assert table["headline"]["outside"] == 2
    assert len(table["outcomes"]) == len(run.outcomes)
    for found, outcome in zip(table["outcomes"], run.outcomes, strict=True):
        whole = outcome.to_dict()
        assert set(found) == set(whole)
        for key, value in whole.items():
            if key in ("samples", "distance_to_silhouette"):
                pairs = [(a, b) for a, b in zip(found[key], value, strict=True) if b is not None]
                np.testing.assert_allclose(*np.array(pairs or [(0, 0)]).T, rtol=1e-3)
            else:
                assert found[key] == json.loads(json.dumps(value)), key


def test_what_is_not_finite_is_null_and_no_invalid_json(tmp_path: Path) -> None:
    write_json(tmp_path / "index.json", run_of(hits(), distances(ours_error=math.inf)))
    text = (tmp_path / "index.json").read_text(encoding="utf-8")
    assert "NaN" not in text and "Infinity" not in text
    assert json.loads(text)["outcomes"][0]["ours_error"] is None


def test_the_headline_counts_questions_of_each_precision_once() -> None:
    line = Headline.of(failing_run())
    assert (line.scenes, line.terms, line.outcomes, line.failed) == (2, 5, 10, 1)
    assert line.questions == 3 * 1000 + 384  # hits of three outcomes, a mask; the other terms ask for numbers
    assert (line.outside, line.inside) == (2, 2)
    assert line.mitsuba is not None and line.mitsuba.bound.used == 3 / 8
    assert line.nearest is not None and line.nearest.margin == 8 / 3


def test_a_term_that_no_ray_met_is_no_comparison(tmp_path: Path) -> None:
    run = run_of(hits(), distances(rays=0, measured=0.0))
    assert Headline.of(run).outcomes == 1
    assert "no ray met it" in (matrix(run.outcomes)[1]["room"][1] or pytest.fail()).says
    assert "| distance, plane | no rays |" in summary_markdown(run)
    assert "no rays" in written(tmp_path, run).words


def test_failures_come_first_everywhere() -> None:
    run = failing_run()
    assert failures_first(run.outcomes)[0] is run.outcomes[-1]
    rows = term_rows(run.outcomes)
    assert rows[0].term == "hits" and rows[0].worst.scene == "other" and rows[0].failed == 1
    assert [used(row.worst) for row in rows] == sorted((used(row.worst) for row in rows), reverse=True)


@pytest.mark.parametrize(
    "broken",
    [
        hits(measured=1.0),
        hits(excluded=5),
        distances(measured=17.0),
        distances(ours_error=17.0),
        distances(mitsuba_error=9.0),
        distances(measured=math.nan),
    ],
)
def test_an_outcome_failed_where_more_than_all_is_used(broken: Outcome) -> None:
    assert not broken.passed and used(broken) > 1
    assert not matrix((broken,))[1]["room"][0].passed  # type: ignore[union-attr]


def test_the_matrix_leaves_out_what_does_not_apply_and_keeps_the_order_of_terms() -> None:
    terms, rows = matrix((distances(), chains(), distances("b"), hits("b"), chains("b")))
    assert terms == ["distance, plane", "hits", "chain growth"]
    assert [cell is None for cell in rows["room"]] == [False, True, False]
    assert [shade(share) for share in (0, 1e-9, 1e-3, 1, 2)] == [0, 1, 1, 10, 10]


def test_the_page_is_well_formed_and_loads_nothing(tmp_path: Path) -> None:
    page = written(tmp_path, failing_run())
    assert page.open == []
    assert len(set(page.ids)) == len(page.ids)
    assert {link for link in page.links if link} <= {f"#{name}" for name in page.ids}
    assert not [load for load in page.loads if load and not load.startswith("data:")]
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"@import|url\((?!#)", text)
    assert not re.search(r"#0[1-8]0\w0\w\b", text), "a color that does not follow the look"


def test_the_page_says_what_failed_and_how_to_repeat_it(tmp_path: Path) -> None:
    words = written(tmp_path, failing_run()).words
    for said in ("1 of 10 comparisons failed", COMMAND, f"{COMMAND} --pixel 7 8", "guilty: mitsuba",
                 "A scene was left out.", "ΔE2000 max 0.5", "1 hit something on one side only"):  # fmt: skip
        assert said in words, said
    assert all(name in words for name in TOLERANCES)


def test_names_are_text_and_no_markup(tmp_path: Path) -> None:
    run = run_of(picture("<b>bold"), hits("<b>bold"), chains('"><script>x'), notes=("<i>note",))
    page = written(tmp_path, run)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "<b>bold" not in text and "<i>note" not in text and "<script>x" not in text
    assert "<b>bold" in page.words and page.open == []
    assert "<b>" not in summary_markdown(run)


def test_a_run_without_outcomes_says_so(tmp_path: Path) -> None:
    run = Validation({}, ())
    words = written(tmp_path, run).words
    assert "Nothing was compared" in words and "passed" not in words.partition("How to read")[0].split("{")[0]
    assert "Nothing was compared." in summary_markdown(run)
    write_json(tmp_path / "index.json", run)


def test_a_scene_without_pictures_and_differing_rays_says_so(tmp_path: Path) -> None:
    words = written(tmp_path, run_of(hits(differing=(), excluded=0))).words
    assert "The one comparison passed" in words
    assert "No picture was compared in this scene." in words and "No differing ray is listed." in words


def test_equal_pictures_have_no_bar(tmp_path: Path) -> None:
    same = np.full((4, 5), -1.0)
    trio = trio_of(Panels("depth", same, same.copy(), np.zeros((4, 5), bool)))
    assert (trio.range, trio.differing, trio.rings, trio.near) == ("", 0, [], "")
    equal = picture(panels=Panels("color", np.ones((4, 5, 3)), np.ones((4, 5, 3)), np.zeros((4, 5), bool)))
    assert "not a single pixel differs" in written(tmp_path, run_of(equal)).words


def test_the_range_of_a_difference_holds_all_but_what_is_counted_as_different() -> None:
    panels = picture().panels
    assert panels is not None
    trio = trio_of(panels)
    assert (trio.range, trio.beyond, trio.differing, trio.rings) == ("10⁻⁵", 1, 1, [(4.5, 5.5)])


def test_the_summary_has_a_row_a_term_and_ends_with_the_command() -> None:
    text = summary_markdown(failing_run())
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert rows[2].startswith("| hits | **1 failed** (mitsuba) | 2 | other | 3,000 | 2 | 0 | rays |")
    assert all(line.count(" | ") == rows[0].count(" | ") for line in rows[1:7])
    assert "| date | 2026-01-02 03:04 UTC |" in rows
    assert text.endswith(f"    {COMMAND}\n")


def test_the_headline_is_put_between_its_markers(tmp_path: Path) -> None:
    file = tmp_path / "README.md"
    file.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", encoding="utf-8")
    for _ in range(2):
        rewrite_headline(file, failing_run())
        lines = file.read_text(encoding="utf-8").splitlines()
        assert lines[:2] == ["before", BEGIN] and lines[-2:] == [END, "after"]
        assert 2 <= len(lines[2:-2]) <= 4 and "**1 failed**" in lines[2] and "**2**" in lines[3]


@pytest.mark.parametrize("text, missing", [("", BEGIN), (BEGIN, END), (f"{END}{BEGIN}", END)])
def test_a_missing_marker_is_named_with_its_file(tmp_path: Path, text: str, missing: str) -> None:
    file = tmp_path / "README.md"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=rf'README\.md: the marker "{missing}" is missing'):
        rewrite_headline(file, failing_run())
    assert file.read_text(encoding="utf-8") == text


def test_a_folder_that_is_not_there_is_an_error_of_the_output(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        write_json(tmp_path / "none" / "index.json", run_of(hits()))


def test_the_header_names_versions_and_settings_in_order_and_no_path(repository: Path) -> None:
    header = header_of(COMMAND, ("single", "double"), "llvm", 20_000, 7)
    names = list(header)
    assert names[:2] == ["date", "tracer"] and names[-1] == "command to repeat"
    assert {"Mitsuba", "Dr.Jit", "LLVM", "NumPy", "Python", "system", "processor", "GPU"} <= set(names)
    assert header["precisions"] == "single, double" and header["rays a scene"] == "20,000"
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", header["date"])
    assert all(header.values()) and not [value for value in header.values() if str(repository) in value]


def test_numbers_and_units_as_people_read_them() -> None:
    assert [number(value) for value in (0, 12345, 4.0999, 0.25, 1e-4, 8e-5, math.inf, math.nan)] == [
        "0", "12,345", "4.10", "0.25", "10⁻⁴", "8·10⁻⁵", "∞", "–",
    ]  # fmt: skip
    assert [percent(share) for share in (0, 1e-9, 0.05, 0.5, 3)] == [
        "0 %",
        "< 0.1 %",
        "5.0 %",
        "50 %",
        "300 %",
    ]
    assert unit("eps (1 + eta^2) / sqrt k, steps") == "ε (1 + η²) / √k, steps"
