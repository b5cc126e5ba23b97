"""Tasks of the results and figures of a study: every topic and figure once, and the same study in another process."""

import pickle
from pathlib import Path

import pytest

from made_study import made_study, random_blocks
from netboard.analysis.extraction.study import share, study_in
from netboard.analysis.extraction.workers import begun
from netboard.analysis.topics import primary, testing
from netboard.analysis.topics.everything import PICTURES, TOPICS, USED, results_of, study_tasks

pytest.importorskip("statsmodels")


def test_every_topic_and_figure_is_in_one_task() -> None:
    tasks = list(study_tasks())
    topics = [topic for task in tasks for topic in task.topics]
    assert sorted(map(repr, topics)) == sorted(map(repr, {*TOPICS} - {primary.primary, testing.families}))
    draws = [draw for task in tasks for draw in task.draws]
    assert sorted(map(repr, draws)) == sorted(map(repr, {*PICTURES} - {primary.picture}))
    assert len({task.name for task in tasks}) == len(tasks)
    assert {*USED} <= {*topics}


def test_task_is_the_same_in_another_process() -> None:
    for task in study_tasks():
        again = pickle.loads(pickle.dumps(task))
        assert (again.name, again.topics, again.draws) == (task.name, task.topics, task.draws)


def test_tasks_without_workers_are_done_when_their_results_are_asked_for() -> None:
    done = []
    found = begun(None, lambda task: done.append(task) or len(done), ["a", "b"])  # type: ignore[func-returns-value]
    assert done == []
    assert list(found) == [("a", 1), ("b", 2)]


def test_shared_study_gives_the_same_results(tmp_path: Path) -> None:
    study = made_study(random_blocks())
    shared = study_in(share(study, tmp_path / "study"))
    assert shared is not study
    assert study_in(study) is study
    topics = TOPICS[1:4]
    assert results_of(shared, topics).equals(results_of(study, topics))
