"""The report of a study is one valid, self-contained and complete page."""

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from declared_study import DECLARED, TWO, crossed_study
from netboard.analysis.extraction.settings import Exclusions, Filters, Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.report.answer import compatible
from netboard.analysis.report.html import write_report
from netboard.analysis.topics import primary
from netboard.analysis.topics.everything import drawn
from netboard.analysis.topics.figure import TopicFigure, new_figure
from netboard.analysis.topics.result import table_of
from netboard.base.errors import NetboardError
from pages import Element, read_page
from report_studies import block, few_results, provenance_of, sha256_of, small_study

NOTHING = table_of([])


def picture(name: str = "learning", points: int = 5) -> TopicFigure:
    """A figure with markers and clipping, whose SVG refers to ids."""
    figure, (axes,) = new_figure(2.0)
    axes.plot(np.arange(points), np.random.default_rng(1).random(points), "o-", label="people & others")
    axes.legend()
    return TopicFigure(name, f"The {name}", f"What {name} is; n = 4 dyads.", figure)


def written(
    folder: Path, study: StudyData, pictures: Sequence[TopicFigure] = (), results: pd.DataFrame = NOTHING
) -> Element:
    return read_page(write_report(folder, study, results, pictures, provenance_of(study)))


def section(page: Element, name: str) -> Element:
    (found,) = [one for one in page.all("section") if one["aria-labelledby"] == name]
    return found


def test_design_and_trials_name_conditions_as_the_results_do(tmp_path: Path) -> None:
    page = written(tmp_path, small_study())
    for name in ("design", "trials"):
        assert "bimanual, haptics on" in section(page, name).text
        assert "bimanual, full" not in section(page, name).text


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Element:
    """A report with everything in it."""
    readings = Readings(
        Filters(slow=6.0), exclusions=Exclusions(trials=("made_2/3: the phone rang", "made_2/1: a noise"), warm_up=1)
    )
    study = small_study(readings)
    comparison = pd.DataFrame(
        {
            "figure": ["2A", "3A"],
            "quantity": ["completion time", "dyads better"],
            "group": ["bimanual, first 30", "haptics on"],
            "said": ["first 30", "4 of 4 dyads"],
            "reported": [5.71, 4.0],
            "reported_sd": [4.48, np.nan],
            "reported_of": [0, 4],
            "value": [5.1, np.nan],
            "low": [4.0, np.nan],
            "high": [6.2, np.nan],
            "unit": ["s", "1"],
            "interval": ["SD", ""],
            "n": [40, 0],
            "of": ["trial", ""],
            "verdict": ["-0.14 SD", "not in this study"],
            "note": ["", ""],
        }
    )
    origin = provenance_of(
        study,
        left_out=[{"file": "recordings/half.mcap.part", "why": "it is not finished"}],
        handedness={"D01A": "left"},
        command="netboard analyse recordings",
        made_utc="2026-03-05 10:00",
    )
    folder = tmp_path_factory.mktemp("report")
    return read_page(write_report(folder, study, few_results(), [picture(), picture("dyads")], origin, comparison))


def test_page_has_every_section_with_a_heading(whole: Element) -> None:
    names = [one["aria-labelledby"] for one in whole.all("section")]
    assert names == [
        "question",
        "summary",
        "controls",
        "design",
        "participants",
        "quality",
        "figures",
        "results",
        "comparison",
        "trials",
        "settings",
        "sources",
    ]
    assert {one["id"] for one in whole.all("h2")} == set(names)
    assert [len(whole.all(tag)) for tag in ("header", "nav", "main", "footer", "h1")] == [1, 1, 1, 1, 1]


def test_ids_are_unique_and_links_have_targets(whole: Element) -> None:
    ids = [one["id"] for one in whole.all() if "id" in one.attributes]
    assert len(set(ids)) == len(ids)
    referred = [one["href"] for one in whole.all() if "href" in one.attributes]
    referred += [f"#{one[name]}" for one in whole.all() for name in ("aria-labelledby",) if name in one.attributes]
    referred += re.findall(
        r"url\((#[^)]+)\)", " ".join(v or "" for one in whole.all() for v in one.attributes.values())
    )
    assert len(referred) > 30
    assert {target.removeprefix("#") for target in referred} <= set(ids)


def test_page_loads_nothing_and_runs_no_script(whole: Element) -> None:
    assert {one.tag for one in whole.all()} & {"script", "link", "iframe", "object", "embed", "base", "form"} == set()
    assert not [name for one in whole.all() for name in one.attributes if name.startswith("on") or name == "srcset"]
    sources = [one[name] for one in whole.all() for name in ("src", "href", "data") if name in one.attributes]
    assert all(source.startswith(("#", "data:image/")) for source in sources)
    (style,) = whole.all("style")
    assert not re.search(r"url\(|@import|//", str(style.children[0]))
    (policy,) = [one["content"] for one in whole.all("meta") if "http-equiv" in one.attributes]
    assert policy.startswith("default-src 'none'")


def test_tables_have_captions_and_headings(whole: Element) -> None:
    for table in whole.all("table"):
        assert table.all("caption") or "trials" in table["class"]
        headings = table.all("th")
        assert headings
        assert {one["scope"] for one in headings} <= {"col", "row"}
        widths = {len(row.all("th")) + len(row.all("td")) for row in table.all("tr")}
        assert len(widths) == 1


def test_a_missing_figure_is_a_sentence_and_has_no_number_and_no_caption(tmp_path: Path) -> None:
    missing = TopicFigure("dyads", "Dyads and partners", "No participant performed alone.", None)
    page = written(tmp_path, small_study(), [picture("learning"), missing, picture("delay")])
    figures = section(page, "figures")
    assert [one.text.partition(" What")[0] for one in figures.all("figcaption")] == ["Figure 1.", "Figure 2."]
    assert [one["id"] for one in figures.all("figure")] == ["figure-learning", "figure-delay"]
    (sentence,) = [one.text for one in figures.all("p") if one.attributes.get("class") == "absent"]
    assert sentence == "Dyads and partners: no figure. No participant performed alone."


def test_every_figure_has_a_title_a_caption_and_a_description(whole: Element) -> None:
    figures = whole.all("figure")
    assert [one["id"] for one in figures] == ["figure-learning", "figure-dyads"]
    for one, name in zip(figures, ("learning", "dyads"), strict=True):
        assert one.all("h3")[0].text == f"The {name}"
        assert one.all("figcaption")[0].text.endswith(f"What {name} is; n = 4 dyads.")
        (svg,) = one.all("svg")
        assert svg["role"] == "img"
        assert [svg.all(tag)[0].text for tag in ("title", "desc")] == [f"The {name}", f"What {name} is; n = 4 dyads."]
        assert svg["aria-labelledby"] == svg.all("title")[0]["id"]
        assert svg.all("use")
        assert "people & others" in svg.text


def test_header_states_the_counts_of_the_study(whole: Element) -> None:
    facts = dict(zip((one.text for one in whole.all("dt")), (one.text for one in whole.all("dd")), strict=True))
    assert whole.all("h1")[0].text == "made up"
    assert facts == {
        "Dyads": "1",
        "Recordings": "5, 0.0833 h",
        "Trials": "9 counted of 15 done, in 20 attempts",
        "Recorded": "2026-03-04",
        "Analysed": "2026-03-05 10:00",
    }


def test_summary_states_intervals_n_and_limits_of_few_dyads(whole: Element) -> None:
    text = section(whole, "summary").text.replace("\N{NO-BREAK SPACE}", " ")
    assert (
        "The share of cooperative movement, haptics on minus haptics off, was −5.00 % points in dyadic trials "
        "(95 % t: −12.00 to 2.00, 4 dyads). The data are compatible with no difference (0) and with every "
        "other value in the interval." in text
    )
    rows = [[cell.text for cell in row.all("th") + row.all("td")] for row in section(whole, "summary").all("tr")]
    assert ["Group", "cooperative [%]", "n"] in rows
    assert ["dyadic, haptics on", "20.0 (10.0 to 30.0)", "4 dyads"] in rows
    assert ["dyadic, haptics on vs off", "−5.00 (−12.00 to 2.00)", "4 dyads"] in rows
    assert ["haptics on", "4 of 4", "4 dyads"] in rows
    assert (
        "n is 1 dyad, however many trials there are. Here the smallest possible p of an exact two-sided test within "
        "dyads is 1" in section(whole, "question").text
    )


def test_page_lists_block_orders_and_participants(whole: Element) -> None:
    plan = section(whole, "design").all("table")[0]
    assert [cell.text for cell in plan.all("td")] == [
        *("A haptics on", "B haptics on", "A haptics off", "B haptics off", "both haptics on")
    ]
    assert "Every dyad performed 4 bimanual blocks before its first dyadic block" in section(whole, "question").text
    people = [
        [cell.text for cell in row.children if isinstance(cell, Element)]
        for row in section(whole, "participants").all("tr")[1:]
    ]
    assert people == [
        ["D01A", "D01", "left", "right", "2", "1", "no"],
        ["D01B", "D01", "not known", "left", "2", "1", "no"],
    ]


def test_dyads_shared_by_several_studies_are_noted(tmp_path: Path, whole: Element) -> None:
    assert "more than one study" not in section(whole, "question").text
    study = study_of([block("a"), block("b", study="another", block=2), block("c", study="", dyad="D02")], Readings())
    note = "1 dyad pseudonym in more than one study (another, made up): each is treated as one dyad"
    assert note in section(written(tmp_path, study), "question").text


def test_excluded_attempts_are_listed_with_all_reasons(whole: Element) -> None:
    (table,) = [one for one in section(whole, "quality").all("table") if "with all reasons" in one.text]
    listed = {tuple(cell.text for cell in row.children if isinstance(cell, Element)) for row in table.all("tr")[1:]}
    warm_up = "the first trial of the block"
    twice = f"{warm_up}; excluded by the experimenter: a noise"
    expected = {(f"made_{k}", "1", at, twice if k == 2 else warm_up) for k in range(1, 6) for at in ("1", "2")}
    assert listed == expected | {("made_2", "3", "1", "excluded by the experimenter: the phone rang")}
    row = next(one for one in whole.all("tr") if one.attributes.get("id") == "r2t3a1")
    assert "excluded: excluded by the experimenter: the phone rang" in row.text
    assert "recordings/half.mcap.part it is not finished" in section(whole, "quality").text


def test_page_lists_recording_hashes_and_replay_commands(whole: Element) -> None:
    sources = section(whole, "sources").text
    assert all(sha256_of(f"made_{k}") in sources for k in range(1, 6))
    rows = [one for one in section(whole, "trials").all("tr") if "id" in one.attributes]
    assert len(rows) == 20
    commands = [row.all("code")[0].text for row in rows]
    assert commands[0] == "netboard replay recordings/made_1.mcap --at 1.5"
    assert all(re.fullmatch(r"netboard replay recordings/made_\d\.mcap --at \d+\.\d", one) for one in commands)
    explained = [row.all("code")[1].text for row in rows]
    assert explained[:3] == [
        "netboard explain recordings/made_1.mcap --trial 1 --attempt 1",
        "netboard explain recordings/made_1.mcap --trial 1",
        "netboard explain recordings/made_1.mcap --trial 2",
    ]
    assert all(row.all("path")[0]["d"].startswith("M") for row in rows)


def test_changed_settings_are_marked(whole: Element) -> None:
    changed = [row.text for row in section(whole, "settings").all("tr") if row.attributes.get("class") == "marked"]
    assert [text.split()[0] for text in changed] == ["slow", "warm_up", "trials"]
    assert changed[0].startswith("slow 6.0 Hz changed; default: 5.0 cutoff for the board")
    names = {row.all("th")[0].text for row in section(whole, "settings").all("tr") if row.all("td")}
    assert {"fast", "threshold", "extent", "pilots"} <= names


def test_page_has_results_and_comparison_with_the_paper(whole: Element) -> None:
    cells = [[cell.text for cell in row.all("td")] for row in section(whole, "results").all("tr") if row.all("td")]
    assert cells[0] == ["bimanual, first 30", "5.71", "1.23", "10.19", "s", "SD", "720", "trial", ""]
    assert cells[3][-1] == "1"
    assert section(whole, "results").all("li")[0].text == "of the time"
    rows = [[cell.text for cell in row.all("td")] for row in section(whole, "comparison").all("tr") if row.all("td")]
    assert rows[0][3:7] == ["5.71 ± 4.48 s", "5.10 s", "± 1.10 (SD)", "40 trials"]
    assert rows[1][3:8] == ["4 of 4", "–", "", "", "not in this study"]


def test_undeclared_study_is_exploratory_and_has_its_summary_open(whole: Element) -> None:
    head = section(whole, "question")
    assert "The recordings state no question." in head.text
    assert "This study declares no primary outcome and no contrast." in head.text
    assert "no test was chosen before the data were seen, and none of its 0 tests counts" in head.text
    opened = [one.all("details")[0].attributes for one in whole.all("section") if one["aria-labelledby"] != "question"]
    assert ["open" in one for one in opened] == [True] + [False] * 10
    assert "1 dyad in 3 conditions: 15 trials planned, 15 done, 9 counted; 11 attempts excluded." in head.text


def test_declared_study_begins_with_its_answer(tmp_path: Path) -> None:
    study = crossed_study(DECLARED, TWO)
    shown = drawn(study, primary.picture)
    page = written(tmp_path, study, [shown, picture()])
    head = section(page, "question")
    assert head.all("p")[0].text == "Does it help more with a person?"
    assert "in all 24 recordings before the first trial: primary outcome completion time" in head.text
    assert [one["id"] for one in head.all("figure")] == ["figure-primary"]
    assert "no test was chosen" not in head.text
    assert not any("open" in one.attributes for one in page.all("details"))
    cells = {row.all("th")[0].text: [cell.text for cell in row.all("td")] for row in head.all("table")[1].all("tr")[1:]}
    times = study.counted.assign(log=np.log(study.counted["completion"]))
    means = times.groupby(["dyad", "factor_mass", "factor_partner"])["log"].mean().unstack([1, 2])
    gaps = means["heavy", "person"] - means["light", "person"] - means["heavy", "robot"] + means["light", "robot"]
    test = stats.ttest_1samp(gaps, 0.0)
    low, high = np.exp(test.confidence_interval(0.95))
    row = cells["mass: heavy vs light x partner: person vs robot"]
    assert row[:3] == ["primary", f"{np.exp(gaps.mean()):.2f}", f"{low:.2f} to {high:.2f}"]
    assert row[3:7] == ["t test", f"{test.statistic:.2f}".replace("-", "−"), "5", f"{test.pvalue:.3f}"]


def test_sentences_say_what_the_data_exclude_and_what_not() -> None:
    row = {
        "value": 1.07,
        "low": 0.94,
        "high": 1.12,
        "unit": "1",
        "quantity": "completion time: ratio",
        "group": "a vs b",
    }
    assert compatible(row, 1.0) == (
        "The data exclude effects below −6.0\u00a0% and above +12\u00a0%. All effects between them, including no "
        "effect, remain compatible with the data. So the data do not show that there is no effect."
    )
    seconds = row | {"value": 0.4, "low": 0.1, "high": 0.7, "unit": "s", "quantity": "time in target: difference"}
    assert compatible(seconds, 0.0) == (
        "The confidence interval does not contain the value of no effect. "
        "Effects from +0.10\u00a0s to +0.70\u00a0s remain compatible with the data."
    )
    assert "exclude nothing" in compatible(row | {"low": float("nan"), "high": float("nan")}, 1.0)


HOSTILE = "<script>alert(1)</script>\"'&amp;\u202egnp.exe\u200f</td></style>"


def test_hostile_names_are_escaped(tmp_path: Path) -> None:
    names = {"study": HOSTILE, "dyad": HOSTILE, "performer": HOSTILE, "left_by": HOSTILE, "right_by": HOSTILE}
    readings = Readings(exclusions=Exclusions(trials=(f"{HOSTILE}/1: {HOSTILE}",)))
    study = study_of([block(HOSTILE, **names)], readings)
    origin = provenance_of(study, left_out=[{"file": HOSTILE, "why": HOSTILE}], command=HOSTILE)
    evil = TopicFigure("learning", HOSTILE, HOSTILE, picture().figure)
    path = write_report(tmp_path, study, few_results().assign(group=HOSTILE, note=HOSTILE), [evil], origin)
    text = path.read_text(encoding="utf-8")
    page = read_page(path)
    assert "script" not in {one.tag for one in page.all()}
    assert text.count("</style>") == 1
    assert "\u202e" not in text
    assert "\u200f" not in text
    shown = HOSTILE.replace("\u202e", "[U+202E]").replace("\u200f", "[U+200F]")
    assert page.all("h1")[0].text == shown
    assert all(shown in section(page, name).text for name in ("design", "participants", "quality", "trials", "sources"))
    row = next(one for one in page.all("tr") if one.attributes.get("id") == "r1t1a1")
    assert row.all("code")[0].text.startswith("netboard replay $'recordings/<script>alert(1)</script>\"\\x27&amp;\\xe2")


def test_single_recording_without_figures_has_a_page(tmp_path: Path) -> None:
    page = written(tmp_path, study_of([block("only", falls=0)], Readings()))
    assert "No attempt was excluded." in section(page, "quality").text
    assert "No other figures were given" in section(page, "figures").text
    assert "There is no main result" in section(page, "summary").text
    assert "comparison" not in [one["aria-labelledby"] for one in page.all("section")]
    assert not section(page, "results").all("table")


@pytest.mark.slow
def test_large_figure_is_a_png_with_alternative_text(tmp_path: Path) -> None:
    page = written(tmp_path, study_of([block("only")], Readings()), [picture(points=8000)])
    (image,) = page.all("img")
    assert image["src"].startswith("data:image/png;base64,")
    assert image["alt"] == "The learning. What learning is; n = 4 dyads."


@pytest.mark.parametrize(("simulated", "warning"), [(1, "These results are no evidence about people."), (0, "")])
def test_simulated_participants_are_announced(tmp_path: Path, simulated: int, warning: str) -> None:
    page = written(tmp_path, study_of([block("only", simulated=simulated)], Readings()))
    warnings = " ".join(one.text for one in page.all("p") if one.attributes.get("class") == "warning")
    assert (warning in warnings) if warning else (warnings == "")


def test_partly_simulated_or_pilot_study_states_how_much(tmp_path: Path) -> None:
    study = study_of([block("a", simulated=1, pilot=1), block("b", block=2)], Readings())
    warnings = [one.text for one in written(tmp_path, study).all("p") if one.attributes.get("class") == "warning"]
    assert warnings[0].startswith("Simulated participants in 1 of 2 recordings")
    assert warnings[1] == "1 of 2 recordings are marked as pilots."


def test_page_states_the_quality_of_recordings(tmp_path: Path) -> None:
    blocks = [
        block("lossy", missing=600, ticks=59_400, repaired=1, exclude="late_ticks", rows={"flags": "late_ticks"}),
        block("short", trials=2, block=2),
        block("rest", trials=1, block=3, falls=0, rows={"flags": "too_long"}),
    ]
    blocks[1].blocks["trials"][0] = 3
    text = section(written(tmp_path, study_of(blocks, Readings())), "quality").text
    assert (
        "3 recordings: 2 of 3 analysed blocks complete; 600 of 180,000 ticks missing (0.333 %); 1 recording repaired"
        in text
    )
    assert "8 attempts: 6 success, 2 fell; 5 with quality flags; 4 excluded." in text
    assert "late ticks 4 4 yes too many deadline misses" in text
    assert "too long 1 0 no the completion time is too long" in text


def test_page_is_reproducible_to_the_byte(tmp_path: Path) -> None:
    files = []
    for name in ("one", "two"):
        study = small_study()
        files.append(
            write_report(tmp_path / name, study, few_results(), [picture()], provenance_of(study)).read_bytes()
        )
    assert files[0] == files[1]


def test_existing_report_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("mine")
    with pytest.raises(NetboardError, match=r"report\.html: already exists"):
        written(tmp_path, small_study())
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("report.html", "mine")]


def test_unwritable_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(NetboardError, match="cannot be written"):
        written(tmp_path / "file", small_study())


def test_recording_without_provenance_is_a_value_error(tmp_path: Path) -> None:
    study = small_study()
    origin = provenance_of(study)
    del origin["recordings"]["made_3"]
    with pytest.raises(ValueError, match="no recording 'made_3'"):
        write_report(tmp_path, study, NOTHING, [], origin)


@pytest.mark.slow
def test_report_of_a_full_study_is_below_4_mb(tmp_path: Path) -> None:
    blocks = [
        block(
            f"S01_D{1 + k // 18:02}_block{1 + k % 18:02}_5c55ae52",
            trials=60,
            seconds=5.5,
            dyad=f"D{1 + k // 18:02}",
            block=1 + k % 18,
        )
        for k in range(72)
    ]
    study = study_of(blocks, Readings())
    assert len(study.trials) == 4392
    path = write_report(tmp_path, study, NOTHING, [], provenance_of(study))
    assert path.stat().st_size < 4_000_000


def test_every_colour_of_the_page_is_a_role_of_both_themes(tmp_path: Path) -> None:
    study = small_study()
    page = write_report(tmp_path, study, few_results(), [picture()], provenance_of(study)).read_text(encoding="utf-8")
    sheet = page[page.index("<style>") : page.index("</style>")]
    light, dark = re.findall(r":root {(.*?)}", sheet)
    assert "@media screen and (prefers-color-scheme: dark)" in sheet
    for theme in (light, dark):
        assert set(re.findall(r"var\((--[a-z-]+)\)", sheet)) <= set(re.findall(r"(--[a-z-]+):", theme))
    assert not re.search(r"#[0-9a-fA-F]{3,6}\b", sheet.replace(light, "").replace(dark, ""))


CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome") or shutil.which("chromium-browser")


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium to look at the page with")
def test_browser_renders_the_page_without_console_messages(tmp_path: Path) -> None:
    study = small_study()
    path = write_report(tmp_path, study, few_results(), [picture()], provenance_of(study))
    command = [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0"]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", path.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    assert "CONSOLE" not in done.stderr
    assert done.stdout.count("<tr") == path.read_text(encoding="utf-8").count("<tr")
