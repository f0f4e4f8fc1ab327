"""Jobs that `buzz-convert plan --format openjd` writes run under `openjd`: all tasks, any one alone, two runs at once."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
BUZZ = Path(os.environ.get("BUZZ_CONVERT", ROOT / "target" / "release" / "buzz-convert"))
SCENE = ROOT / "scenes" / "courtyard" / "courtyard.gltf"
SIZE = "96x54"


#: Where `buzz-convert`, and the `openjd` of this Python, are found.
PATH = os.pathsep.join([str(BUZZ.parent), str(Path(sys.executable).parent), os.environ["PATH"]])


def openjd(*arguments: object) -> subprocess.Popen:
    """Starts an `openjd` command that finds our program on the path."""
    command = ["openjd", *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    return subprocess.Popen(command, **pipes, env=os.environ | {"PATH": PATH})


def run(*arguments: object) -> str:
    """Runs an `openjd` command to its end."""
    process = openjd(*arguments)
    text, _ = process.communicate(timeout=300)
    assert process.returncode == 0, text
    return text


def plan(folder: Path, *options: str) -> Path:
    """Writes a template into `folder`."""
    command = [BUZZ, "plan", SCENE, "-r", SIZE, "--format", "openjd", *options]
    template = folder / "job.json"
    template.write_bytes(subprocess.run(command, check=True, capture_output=True).stdout)
    return template


def job(template: Path, out: Path, *more: str) -> list:
    """The arguments that run a job."""
    parameters = [f"Input={SCENE}", f"OutputDir={out}", *more]
    return ["run", template, *(argument for p in parameters for argument in ("-p", p))]


def chunks(template: Path) -> list[str]:
    """The ranges of the rendering tasks."""
    (parameter,) = json.loads(template.read_text())["steps"][0]["parameterSpace"]["taskParameterDefinitions"]
    return parameter["range"]


def tasks(ranges: list[str]) -> str:
    """These tasks, as `openjd run --tasks` takes them."""
    return json.dumps([{"Chunk": chunk} for chunk in ranges])


def frames(folder: Path) -> dict[str, bytes]:
    """Every frame in a folder by its name."""
    return {path.name: path.read_bytes() for path in folder.glob("*.exr")}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The frames of a plain run."""
    out = tmp_path_factory.mktemp("plain")
    subprocess.run([BUZZ, SCENE, out, "-r", SIZE, "--progress", "none"], check=True, capture_output=True)
    assert len(frames(out)) == 96
    return frames(out)


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_a_template_is_valid_and_all_of_it_runs(workers: int, tmp_path: Path, plain: dict[str, bytes]) -> None:
    template, out = plan(tmp_path, "--workers", str(workers)), tmp_path / "out"
    run("check", template)
    said = run(*job(template, out))
    assert "openjd_progress: 100.0" in said and "openjd_status: frame 95" in said
    done = frames(out)
    assert done.keys() == plain.keys()
    if workers == 1:
        assert done == plain
    report = json.loads((out / "report.json").read_text())
    assert report["totals"]["frames"] == 96 and len(report["runs"]) == len(chunks(template)) + 1
    assert (out / "report.html").is_file()


def test_any_task_runs_alone(tmp_path: Path, plain: dict[str, bytes]) -> None:
    template = plan(tmp_path)
    for chunk in chunks(template):
        out = tmp_path / chunk
        run(*job(template, out), "--step", "Render", "--task-param", f"Chunk={chunk}")
        first, last = map(int, chunk.split("-"))
        expected = {f"courtyard.{n:04d}.exr" for n in range(first, last + 1)}
        assert frames(out) == {name: plain[name] for name in expected}
        assert (out / f"report.{chunk}.json").is_file()


def test_some_frames_are_asked_for(tmp_path: Path, plain: dict[str, bytes]) -> None:
    template, out = plan(tmp_path), tmp_path / "out"
    said = run(*job(template, out, "Frames=10-30x20"))
    assert "nothing to do" in said
    expected = [f"courtyard.{n:04d}.exr" for n in (10, 30)]
    assert frames(out) == {name: plain[name] for name in expected}
    assert json.loads((out / "report.10-30.json").read_text())["totals"]["frames"] == 2


def test_two_runs_side_by_side_share_a_folder(tmp_path: Path, plain: dict[str, bytes]) -> None:
    template, out = plan(tmp_path, "-j", "1"), tmp_path / "out"
    half = len(chunks(template)) // 2
    halves = [chunks(template)[:half], chunks(template)[half:]]
    running = [openjd(*job(template, out), "--step", "Render", "--tasks", tasks(part)) for part in halves]
    for process in running:
        text, _ = process.communicate(timeout=300)
        assert process.returncode == 0, text
    run(*job(template, out), "--step", "Merge")
    assert frames(out) == plain
    assert json.loads((out / "report.json").read_text())["totals"]["frames"] == 96
    assert not [path.name for path in out.iterdir() if path.name.startswith(".")]


def blocks(language: str) -> list[str]:
    """The blocks of `docs/farm.md` in a language, of a size that is quick to render."""
    text = (ROOT / "docs" / "farm.md").read_text().replace("1920x1080", SIZE)
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def shell(text: str, folder: Path, **variables: str) -> None:
    """Runs a block; stops at its first error."""
    environment = os.environ | {"PATH": PATH} | variables
    done = subprocess.run(["sh", "-euc", text], check=False, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{text}{done.stdout}{done.stderr}"


def test_the_documentation_works_as_written(tmp_path: Path, plain: dict[str, bytes]) -> None:
    shutil.copytree(SCENE.parent, tmp_path, dirs_exist_ok=True)
    (tmp_path / SCENE.name).rename(tmp_path / "shot.gltf")
    expected = {name.replace("courtyard", "shot"): data for name, data in plain.items()}
    out = tmp_path / "out"
    for block in blocks("sh"):
        shutil.rmtree(out, ignore_errors=True)
        if block.startswith("#!"):
            for number, _ in enumerate((tmp_path / "chunks.txt").read_text().splitlines(), 1):
                shell(block, tmp_path, SLURM_ARRAY_TASK_ID=str(number), SLURM_CPUS_PER_TASK="1")
        else:
            shell(block.replace("/shots/010", str(tmp_path)), tmp_path)
        if out.exists():
            done = frames(out)
            # A plan for several workers has key frames of its own.
            assert done.keys() == expected.keys() and ("--workers" in block or done == expected), block
    assert frames(tmp_path / "out2") == {name: data for name, data in expected.items() if name < "shot.0010"}
    for line in (tmp_path / "commands.txt").read_text().splitlines():
        shell(line, tmp_path)
    assert frames(out) == expected


@pytest.mark.skipif(not shutil.which("node"), reason="Node.js is not installed")
def test_flamencos_job_type_has_a_task_for_each_chunk_and_one_that_waits(tmp_path: Path) -> None:
    (script,) = blocks("js")
    stand_in = """
    const author = {
        Task: (name, type) => ({ name, type, commands: [], after: [],
            addCommand(c) { this.commands.push(c) }, addDependency(t) { this.after.push(t.name) } }),
        Command: (name, parameters) => ({ name, ...parameters }),
    };
    const tasks = [];
    const settings = { scene: "a.gltf", out: "out", chunks: "0-4,5-9", options: "-j 2" };
    compileJob({ settings, addTask: (task) => tasks.push(task) });
    console.log(JSON.stringify(tasks));
    """
    tasks = json.loads(subprocess.run(["node", "-e", script + stand_in], check=True, capture_output=True).stdout)
    assert [task["name"] for task in tasks] == ["render 0-4", "render 5-9", "merge"]
    assert tasks[2]["after"] == ["render 0-4", "render 5-9"]
    assert tasks[1]["commands"][0]["args"][-4:] == ["-j", "2", "--frames", "5-9"]
