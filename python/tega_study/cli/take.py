"""Take episodes, relabel and re-encode them: ``tega-teleop recording take``, ``relabel`` and ``encode``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.config import load_config
from tega.ui.cli.options import PATH, answer, json_option, sets_option, worn_by
from tega_study.cli.options import folder_argument, shown_option


@click.command(epilog="Example: tega-teleop recording take lab.toml sessions/monday --task 'lift the bottle'")
@click.argument("config", type=PATH, metavar="CONFIG.toml")
@folder_argument
@click.option("--task", required=True, help="Task of the episodes, in words.")
@click.option(
    "--pedals",
    default="",
    metavar="KEYS",
    help="Keys of a foot switch for continue, discard, repeat: bnm; or buttons of input.marker: left,right.",
)
@click.option("--person", metavar="ID", help="Whose calibration to use (calibration.person).")
@click.option(
    "--episodes", "most", type=click.IntRange(1), help="Number of kept episodes after which to end."
)
@sets_option
@json_option
def take(
    *,
    config: Path,
    folder: Path,
    person: str | None,
    most: int | None,
    sets: tuple[str, ...],
    as_json: bool,
    **requested: str,
) -> None:
    """Take episodes into FOLDER, a recording each: Enter starts, ends and keeps, x discards, r does it again.

    A discarded episode's recording is deleted; episodes.jsonl keeps a line of it. With arm.start_m the arm goes to its
    start after each, while the dead-man is held. With --json: {"folder", "kept", "discarded"}.
    """
    from tega.safety.stop import CtrlC
    from tega_study.episodes.take import EpisodeTaker
    from tega_study.lead.experimenter import desk_for

    settings = load_config(config, sets=worn_by(person, sets)).config
    with CtrlC() as stop, desk_for(stop) as desk:
        taker = EpisodeTaker(settings, folder, desk, stop=stop, settings=str(config), **requested)
        ended = taker.take(most=most)
    kept = [line.file for line in ended if line.step == "kept"]
    discarded = len(ended) - len(kept)
    lines = [f"{folder}: {len(kept)} kept, {discarded} discarded"]
    answer({"folder": str(folder), "kept": kept, "discarded": discarded}, lines, as_json=as_json)


@click.command(
    epilog="Example: tega-teleop recording relabel sessions/monday --task 'lift the bag' trial-002.mcap"
)
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False, exists=True))
@click.argument("files", nargs=-1)
@click.option("--task", required=True, help="Task, in words.")
@json_option
def relabel(*, folder: Path, files: tuple[str, ...], task: str, as_json: bool) -> None:
    """Change the task of the recordings in a session's FOLDER, or of FILES in it.

    The task is stored in session.json, and is the episode's task in a LeRobot dataset. The recordings stay unchanged.
    With --json: the files.
    """
    from tega.recording.mcap_folder import SessionFolder

    named = SessionFolder(folder).label(task, files)
    answer(named, [f"{task}: {', '.join(named)}"], as_json=as_json)


@click.command(
    epilog="Example: tega-teleop recording encode sessions/monday --quality 80 --out sessions/small"
)
@click.argument("session", type=PATH)
@click.option("--out", type=PATH, required=True, help="Folder: new or empty.")
@shown_option("--quality", type=click.IntRange(1, 100), default=90, help="Quality of the JPEG pictures.")
@json_option
def encode(*, session: Path, out: Path, quality: int, as_json: bool) -> None:
    """Copy recordings with their frames encoded as JPEG; everything else stays unchanged.

    SESSION is a file, or a session's folder. Lossless frames become lossy: verify then uses the recorded contacts.
    With --json: the paths.
    """
    from tega.recording.remake import encode_session

    made = [str(path) for path in encode_session(session, out=out, quality=quality)]
    answer(made, made, as_json=as_json)
