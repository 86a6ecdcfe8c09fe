"""`make verify-hostile` in small: 500 inputs, and a control for each of its detectors."""

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from guided_lgp import cli
from guided_lgp.documents import read_json, write_text
from guided_lgp.errors import InputError
from hostile import BEGIN, END, PAGE, RESULT, SEED, inputs, startup_ms, table
from hostility import commands, environments, judge, kills, limits, planted, races
from hostility.kills import Writer
from hostility.loaders import loaders


def test_five_hundred_inputs_end_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = inputs(tmp_path, SEED + 1, 460, 40)
    assert found.faults == []
    figures = found.figures()
    assert figures["tried"] >= 490
    assert min(figures["accepted"], figures["refused"]) > 0


def test_good_files_are_taken(tmp_path: Path) -> None:
    """Else nobody would know whether a reader refuses what is wrong, or all there is."""
    for reader in loaders(tmp_path):
        reader.read(reader.folder)


def unknown_name(number: int) -> object:
    return {}[number]


def endless(number: int) -> None:
    while True:
        pass


def deaf(number: int) -> None:
    time.sleep(60)


def refuses_in_two_screens(number: int) -> None:
    raise InputError("x" * 5000, "is wrong")


@pytest.mark.parametrize(
    ("attempt", "outcome"),
    [
        (unknown_name, "foreign"),
        (lambda number: os.kill(os.getpid(), signal.SIGKILL), "foreign"),
        (lambda number: os._exit(0), "foreign"),
        (refuses_in_two_screens, "foreign"),
        (endless, "slow"),
        (deaf, "slow"),
    ],
    ids=["an exception", "a signal", "an end", "a long line", "a loop", "a hang"],
)
def test_the_judge_sees(
    attempt: Callable[[int], object], outcome: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(judge, "LIMIT_S", 0.2)
    monkeypatch.setattr(judge, "HANG_S", 2.0)
    found = judge.judge(lambda number: None if number == 1 else attempt(number), range(2))
    assert found.counts == {outcome: 1, "accepted": 1}
    assert len(found.faults) == 1


@pytest.mark.parametrize(
    "code",
    [
        "sys.exit(3)",
        "sys.stderr.write('two\\nlines\\n'); sys.exit(2)",
        "sys.stderr.write('x' * 400); sys.exit(2)",
        "sys.stderr.write('\\x1b[31m'); sys.exit(2)",
        "{}['x']",
    ],
)
def test_commands_show_ends_in_other_words(code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, "main", lambda words: exec(code))
    found = judge.judge(lambda number: commands.run(["plan"]), range(1))
    assert found.counts == {"foreign": 1}


def in_place(folder: Path, version: int) -> None:
    """Writes the file itself, with an unfinished one beside it for show."""
    unfinished, file = folder / ".unfinished-a", folder / "a"
    unfinished.unlink(missing_ok=True)
    descriptor = os.open(unfinished, os.O_CREAT | os.O_EXCL | os.O_RDWR)
    file.write_text(f"{version}" * 500)
    os.fsync(descriptor)
    file.write_text(f"{version}" * 1000)
    unfinished.unlink()
    os.close(descriptor)


def grows(folder: Path, version: int) -> None:
    """Writes whole files, and others than before the kill."""
    write_text(folder / f"{len(list(folder.iterdir()))}", f"{version}" * 100)


@pytest.mark.parametrize("work", [in_place, grows])
def test_kills_show_a_writer_that_is_none(
    work: Callable[[Path, int], object], tmp_path: Path
) -> None:
    figures = kills.Figures()
    Writer("naive", work).kill_everywhere(tmp_path, figures)
    assert figures.inside_window >= 3
    assert figures.damaged > 0


def test_kills_show_a_stage_that_does_not_go_on(tmp_path: Path) -> None:
    figures = kills.Figures()
    for part, content in {"undisturbed": "a", "killed": "b"}.items():
        write_text(tmp_path / part / "data" / "same", "same")
        write_text(tmp_path / part / "data" / "other", content)
    write_text(tmp_path / "undisturbed" / "data" / "missing", "")
    kills.compare(tmp_path / "undisturbed", tmp_path / "killed", figures)
    assert figures.damaged == 2


def test_kills_do_not_harm_a_writer(tmp_path: Path) -> None:
    figures = kills.Figures()
    writer = Writer("text", lambda at, n: write_text(at / "a.txt", f"{n}" * 1000))
    writer.kill_everywhere(tmp_path, figures)
    assert figures.inside_window == 2 * len(kills.MOMENTS)
    assert figures.faults == []


def test_races_show_torn_reads(tmp_path: Path) -> None:
    figures = races.Figures()
    races.write_at_once(tmp_path, figures, 300, write=Path.write_text)
    assert figures.torn > 0


def test_races_show_what_is_lost(tmp_path: Path) -> None:
    figures = races.Figures()
    races.write_at_once(tmp_path, figures, 1, write=lambda file, _: write_text(file, "0" * 5000))
    assert figures.lost == 1


def test_races_show_processes_that_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    failing = (sys.executable, "-c", "import sys; open(sys.argv[-1], 'w').write('{}'); sys.exit(3)")
    monkeypatch.setattr(races, "PROGRAM", failing)
    for name in ("_SEVEN", "_REPAIR", "_RECORD"):
        monkeypatch.setattr(races, name, "raise SystemExit(3)")
    work: dict[str, tuple[Callable[[Path, races.Figures], None], int]] = {
        "plans": (races.plan_at_once, 4),
        "compiled": (races.compile_at_once, 4),
        "repairs": (races.repair_at_once, 4),
        "stages": (partial(races.run_stage_at_once, processes=2), 2),
        "mlflow": (partial(races.record_at_once, processes=2), 2),
    }
    for name, (race, lost) in work.items():
        figures = races.Figures()
        (tmp_path / name).mkdir()
        race(tmp_path / name, figures)
        assert figures.lost == lost, name


def test_races_show_a_stage_that_mixes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import os, pathlib as p; p.Path('data').mkdir(exist_ok=True); "
    code += "p.Path('data/a').write_text(os.getcwd())"
    monkeypatch.setattr(races, "PROGRAM", (sys.executable, "-c", code))
    figures = races.Figures()
    races.run_stage_at_once(tmp_path, figures, 2)
    assert (figures.torn, figures.lost) == (1, 0)


def test_writers_at_once_tear_nothing(tmp_path: Path) -> None:
    figures = races.Figures()
    races.write_at_once(tmp_path, figures, 50)
    assert figures == races.Figures(runs=4)


def trusting(place: planted.Place) -> Callable[[], None]:
    """Opens the library that lies in the cache."""
    return lambda: ctypes.CDLL(str(next(place.cache.glob("seven-*.so")))) and None


def test_planted_code_shows_where_it_is_run(tmp_path: Path) -> None:
    place = planted.Place(tmp_path / "a")
    assert planted.is_effective(place.folder, planted.another_library, trusting(place))


def test_planted_links_show_where_they_are_followed(tmp_path: Path) -> None:
    def naive(place: planted.Place) -> None:
        (place.folder / "target").symlink_to(place.precious)
        (place.folder / "target").write_text("new")

    assert planted.act_is_effective(tmp_path / "a", naive)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can act as somebody else")
def test_what_root_plants_for_another_shows_where_it_is_trusted() -> None:
    def trusting(place: planted.Place) -> None:
        ctypes.CDLL(str(next(place.cache.glob("seven-*.so"))))

    for real in planted.REAL_USERS:
        assert planted.is_effective_for_another(planted.roots_folder, trusting, real)
        for plant, act in planted.BY_ROOT.items():
            assert not planted.is_effective_for_another(plant, act, real)


def test_nothing_planted_is_effective(tmp_path: Path) -> None:
    for plant in planted.PLANTS:
        assert not planted.is_effective(tmp_path / plant.__name__, plant)
    for act in set(planted.ACTS) - {planted.planted_package}:  # which compiles for half a minute
        assert not planted.act_is_effective(tmp_path / act.__name__, act)


def test_a_full_disk_shows_a_writer_in_place(tmp_path: Path) -> None:
    def naive(folder: Path, version: int) -> None:
        (folder / "a").write_text("a" * (1 + version * 50_000))

    def whole(folder: Path, version: int) -> None:
        write_text(folder / "a", "a" * (1 + version * 50_000))

    found = []
    for write in (naive, whole):
        figures = limits.Figures()
        limits.write_on_full_disks([Writer("one", write)], tmp_path / write.__name__, figures)
        assert figures.tried == 3
        found.append((figures.torn > 0, figures.foreign > 0))
    assert found == [(True, True), (False, False)]


def test_little_memory_shows_half_a_plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import sys; open(sys.argv[-1], 'w').write('{'); print(1, 2, sep='\\n', file=sys.stderr)"
    monkeypatch.setattr(limits, "PROGRAM", f"{code}; sys.exit(3)")
    figures = limits.Figures()
    limits.plan_with_little_memory(tmp_path / "a", figures)
    assert (figures.torn, figures.foreign) == (figures.tried, figures.tried)


def test_an_environment_that_matters_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import os, pathlib as p; p.Path('data').mkdir(); p.Path('data/a').write_text({})"
    figures = environments.Figures()
    for index, text in enumerate(("'a'", "str(os.environ.get('HOME'))")):
        monkeypatch.setattr(environments, "WORK", code.format(text))
        first, second = (
            environments.digests(environment, tmp_path / f"{index}{n}", tmp_path / "none")
            for n, environment in enumerate(
                (environments.Environment("ordinary"), environments.ENVIRONMENTS[0])
            )
        )
        environments.compare(first, second, "no HOME", figures)
    assert (figures.tried, figures.different) == (2, 1)


def test_the_published_figures_hold(tmp_path: Path) -> None:
    """Nothing came through, as often as was aimed at; and a few rows come out again."""
    figures = read_json(RESULT)
    assert figures["seed"] == SEED
    assert f"{BEGIN}\n\n{table(figures)}\n{END}" in PAGE.read_text(encoding="utf-8")
    tried = figures["inputs"]
    assert tried["tried"] >= 30_000
    assert tried["tried"] == sum(row["tried"] for row in tried["by_reader"].values())
    assert tried["tried"] == tried["accepted"] + tried["refused"]
    assert (tried["foreign"], tried["slow"]) == (0, 0)
    assert figures["kills"]["inside_window"] >= 200
    assert figures["kills"]["in_stages"] >= 20
    assert figures["kills"]["damaged"] == 0
    assert (figures["races"]["torn"], figures["races"]["lost"]) == (0, 0)
    own = len((*planted.OF_OTHERS, *planted.PLANTS, *planted.ACTS))
    for_another = len(planted.BY_ROOT) * len(planted.REAL_USERS)
    assert figures["planted"]["tried"] == own + for_another
    assert figures["planted"]["effective"] == 0
    assert figures["limits"]["tried"] >= 50
    assert (figures["limits"]["torn"], figures["limits"]["foreign"]) == (0, 0)
    assert figures["environments"] == {"tried": len(environments.ENVIRONMENTS), "different": 0}
    assert figures["startup_ms"] <= 10
    rows = {reader.name: reader for reader in loaders(tmp_path)}
    for name in ("data set", "JSON", "YAML"):
        row = tried["by_reader"][name]
        attempt = partial(rows[name].attempt, SEED)
        assert judge.judge(attempt, range(row["tried"])).figures() == row


def test_the_checks_at_the_start_cost_little() -> None:
    assert startup_ms() <= 10
