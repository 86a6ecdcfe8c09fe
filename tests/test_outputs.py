"""Files that a command is to write are refused before it plans."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from guided_lgp import cli
from guided_lgp.cli.outputs import destinations, named_files
from guided_lgp.errors import InputError
from guided_lgp.paths import EXAMPLES

SOMEBODY = 54322


def refused(out: Path, html: Path | None = None, *inputs: Path) -> str:
    with pytest.raises(InputError) as caught:
        destinations({"--out": out, "--html": html}, inputs)
    return str(caught.value)


def loop(folder: Path) -> Path:
    (folder / "loop").symlink_to("loop")
    return folder / "loop"


@pytest.mark.parametrize(
    ("file", "fault"),
    [
        (lambda folder: folder, "is a folder"),
        (lambda folder: Path(), "is a folder, or no name"),
        (lambda folder: folder / ("x" * 300), "File name too long"),
        (lambda folder: folder / "none" / "plan.json", "folder does not exist"),
        (lambda folder: folder / "scene.json" / "plan.json", "Not a directory"),
        (lambda folder: folder / "a\0b", "is no name of a file"),
        (lambda folder: Path("/proc/plan.json"), "Permission denied"),
        (loop, "cannot be written"),
    ],
)
def test_what_cannot_be_written(file: Callable[[Path], Path], fault: str, tmp_path: Path) -> None:
    (tmp_path / "scene.json").touch()
    if fault == "Permission denied" and os.access("/proc", os.W_OK):
        pytest.skip("this user may write anywhere")
    message = refused(file(tmp_path))
    assert message.startswith("--out ")
    assert fault in message


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can act as somebody else")
@pytest.mark.parametrize(("mode", "refuses"), [(0o777, False), (0o1777, True), (0o755, True)])
def test_whoever_acts_has_to_be_allowed_to(mode: int, refuses: bool) -> None:
    """Others' files in a sticky folder, such as /tmp, cannot be replaced."""
    with TemporaryDirectory() as folder:
        Path(folder).chmod(mode)
        file = Path(folder) / "plan.json"
        file.touch()
        os.seteuid(SOMEBODY)
        try:
            if refuses:
                assert "Permission denied" in refused(file)
            else:
                assert destinations({"--out": file}, []) == {"--out": file.resolve()}
        finally:
            os.seteuid(0)


def test_inputs_and_the_other_file_are_not_overwritten(tmp_path: Path) -> None:
    scene, models = tmp_path / "scene.json", tmp_path / "models"
    models.mkdir()
    weights = models / "weights.json"
    link, other = tmp_path / "link", tmp_path / "other"
    link.symlink_to(scene)
    for file in (scene, weights):
        file.touch()
    other.hardlink_to(scene)
    for file in (scene, link, other, weights):
        assert "is read by this command" in refused(file, None, scene, models)
    assert "is also the file of --out" in refused(tmp_path / "x", models / ".." / "x")
    assert "is also the file of --out" in refused(Path("-"), Path("-"))


def test_links_are_followed_and_streams_are_accepted(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("new")
    accepted = destinations({"--out": tmp_path / "link", "--html": tmp_path / "pipe"}, [tmp_path])
    assert accepted == {"--out": tmp_path / "new", "--html": tmp_path / "pipe"}
    null = Path("/dev/null")
    assert destinations({"--out": null, "--html": null}, []) == {"--out": null, "--html": null}
    assert destinations({"--out": None, "--html": Path("-")}, [])["--html"] == Path("-")


def test_what_a_scene_names_is_not_overwritten(tmp_path: Path) -> None:
    mesh, robot = tmp_path / "wedge.obj", tmp_path / "own.yaml"
    mesh.touch()
    robot.touch()
    boxes = [{"name": "red"}, {"mesh": "wedge.obj"}, {"mesh": "x" * 300}, {"mesh": 1}]
    document = {"robot": {"model": str(robot)}, "boxes": boxes}
    named = list(named_files(document, tmp_path))
    for file in (mesh, robot):
        assert "is read by this command" in refused(file, None, *named)
    assert destinations({"--out": tmp_path / "red"}, named)


def test_given_actions_and_a_scene_are_not_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    actions, scene = tmp_path / "actions", tmp_path / "domain.pddl"
    actions.write_text("(grasp pr2L red)")
    shutil.copy(EXAMPLES / "three_boxes.json", scene)
    for command in (
        ["plan", str(scene), "--skeleton", str(actions), "--out", str(actions)],
        ["pddl", str(scene), "--goal", "(on red green)", "--folder", str(tmp_path)],
    ):
        with pytest.raises(SystemExit) as ended:
            cli.main(command)
        assert ended.value.code == 2
        assert "is read by this command" in capsys.readouterr().err
    assert actions.read_text() == "(grasp pr2L red)"


def test_examples_want_an_empty_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to("nowhere")
    (tmp_path / "full" / "a").mkdir(parents=True)
    for name in ("file", "link", "full"):
        with pytest.raises(SystemExit) as ended:
            cli.main(["examples", str(tmp_path / name)])
        assert ended.value.code == 2
        assert "is not an empty folder" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    for name in ("empty", "new"):
        with pytest.raises(SystemExit) as ended:
            cli.main(["examples", str(tmp_path / name)])
        assert not ended.value.code
        assert (tmp_path / name / "three_boxes.json").is_file()
