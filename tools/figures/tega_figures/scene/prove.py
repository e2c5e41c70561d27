"""Prove the scene cameras' scores on rendered video of simulated trials: errors of place, slip, width and events.

``python -m tega_figures.scene.prove OUT.jsonl`` goes through the design below and adds a line a trial; one that is
there is passed over, so that the same call goes on after a stop. Films (0.4 GB) and the tags that were found in them
are kept beside it. ``python -m tega_figures.scene.accuracy OUT.jsonl`` makes the page's table of it. The design is
fixed, and every trial of it is in the table; :data:`CHOSEN_ON` are those that the method was chosen on. A number after
``OUT.jsonl`` is the seed of the people and of all noise: 1, that of the table, unless given.

The camera's lens is calibrated from rendered pictures of the ChArUco board; the boxes are folded with errors that the
layout does not know (0.1 mm, 0.2°), the table's sheet is printed with some (0.1 mm, 0.05°), and the height of the
object's box over the table is measured with 0.3 mm of error; pictures are encoded as H.264.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec
import numpy as np

from tega.runtime.opencv import load_cv2
from tega_figures.scene.bench import (
    LENS,
    WRIST_MM,
    Occluder,
    RenderedTrial,
    bench_layout,
    board_pictures,
    camera_pose,
    world_pose,
)
from tega_figures.scene.render import Film
from tega_figures.scene.trials import TrueTrial, true_trial
from tega_scene.calibrate import LensCalibration
from tega_scene.decode import SceneDecoder
from tega_scene.layout import PlacedTag, TagBody, TagLayout
from tega_scene.lens import Lens, load_lens, save_lens
from tega_scene.outcomes import SceneCourses, SceneEvent, SceneRule, righted, scene_courses, score_scene
from tega_scene.resting import placed as is_placed
from tega_scene.smoothing import Course
from tega_scene.track import SceneSightings, SceneTrack, follow_bodies, sight_tags
from tega_scene.video import SceneEncoder
from tega_sim.plan import TrialPlan
from tega_sim.score import TrialScorer

if TYPE_CHECKING:
    from numpy.typing import NDArray

TOLERANCE_S: Final = 0.05
CHOSEN_ON: Final = frozenset(
    (
        "bottle µ=0.3 haptic 1",
        "bottle µ=0.3 non-haptic 1",
        "container µ=0.3 haptic 1",
        "container µ=0.3 non-haptic 1",
        "bag µ=0.3 haptic 1",
        "bottle µ=0.45 haptic 1",  # a defect of the search for lost tags was found on it
    )
)
"""Trials of the design whose results the method was changed after; nothing was after the others'."""

_RULER_MM: Final = 0.3
DIM: Final = Film(blur_px=1.0, exposure_s=0.012, shot=0.06, read=3.0)
ROLLING: Final = Film(readout_s=0.015)
_BEFORE_S, _AFTER_LIFTED_S, _AFTER_DROP_S = 0.65, 1.0, 0.3


class ProvenTrial(msgspec.Struct, frozen=True, kw_only=True):
    """One trial of the proof.

    Attributes:
        name: Object, condition, friction, seed.
        rate_hz: Of the camera.
        film: Which: ``bright``, ``dim`` or ``rolling``.
        occluded: Whether something passed before the object.
        placed: Whether it was followed until it was put down.
        n_pictures: How many were looked at.
        object_mm: Errors of the object's place in the pictures that place it, root mean square: in three dimensions,
            along the view, across it (one of the two directions).
        hand_mm: Likewise of the middle of the hand's box.
        claimed_mm: What the fit itself says of the object: along, across.
        slip_mm: Error of the slip while off the table, root mean square.
        width_mm: Error of the width, likewise.
        seen: Share of the pictures with the object, that place it, and with the hand.
        true: Events of the truth.
        measured: Events of the camera.
        put_down_mm: Error of where it was put, where it was.
    """

    name: str
    rate_hz: float
    film: str
    occluded: bool
    placed: bool
    n_pictures: int
    object_mm: tuple[float, float, float]
    hand_mm: tuple[float, float, float]
    claimed_mm: tuple[float, float]
    slip_mm: float
    width_mm: float
    seen: tuple[float, float, float]
    true: tuple[SceneEvent, ...]
    measured: tuple[SceneEvent, ...]
    put_down_mm: float | None = None


def design(seed: int = 1) -> list[tuple[TrialPlan, float, str, bool, bool]]:
    """Return the trials: plan, pictures a second, film, whether occluded, whether followed until put down."""
    trials: list[tuple[TrialPlan, float, str, bool, bool]] = []
    for friction in (None, 0.45, 0.3):
        for number, name in enumerate(("bottle", "container", "bag")):
            for condition in ("haptic", "non-haptic"):
                k = len(trials)
                plan = TrialPlan(object=name, condition=condition, seed=seed, friction=friction)
                film = ("bright", "dim", "bright", "rolling")[(k + seed) % 4]
                trials.append((plan, 60.0 if k in {5, 16} else 30.0, film, k % 2 == 0, k % 8 == number))
    return trials


def folded(layout: TagLayout, rng: np.random.Generator) -> TagLayout:
    """Return where the tags truly are: not quite where the layout says."""
    cv2 = load_cv2("figures")

    def off(tag: PlacedTag, shift_mm: NDArray[np.float64], turn_deg: NDArray[np.float64]) -> PlacedTag:
        turn = cv2.Rodrigues(np.radians(turn_deg))[0]
        return msgspec.structs.replace(
            tag,
            at_mm=tuple((np.array(tag.at_mm) + shift_mm).tolist()),
            x=tuple((turn @ tag.x).tolist()),
            y=tuple((turn @ tag.y).tolist()),
        )

    def body(one: TagBody, shift_mm: tuple[float, ...], turn_deg: tuple[float, ...]) -> TagBody:
        tags = tuple(off(tag, rng.normal(0, shift_mm), rng.normal(0, turn_deg)) for tag in one.all_tags())
        return msgspec.structs.replace(one, tags=tags, cube=None)

    return msgspec.structs.replace(
        layout,
        table=body(layout.table, (0.1, 0.1, 0.0), (0.0, 0.0, 0.05)),
        object=body(layout.object, (0.1, 0.1, 0.1), (0.2, 0.2, 0.2)),
        hand=body(layout.hand, (0.1, 0.1, 0.1), (0.2, 0.2, 0.2)),
    )


def write_film(
    file: Path, pictures: Iterator[tuple[float, NDArray[np.uint8]]], size: tuple[int, int], rate_hz: float
) -> None:
    """Encode pictures as a recording has them, and keep the packets: times, lengths, bytes."""
    encoder = SceneEncoder(*size, rate_hz=rate_hz)
    packets = [one for t_s, image in pictures for one in encoder.encode(image, round(t_s * 1e9))]
    packets += encoder.close()
    data = np.frombuffer(b"".join(packet for _, packet in packets), np.uint8)
    part = file.with_suffix(".part.npz")
    np.savez(part, t_ns=[t_ns for t_ns, _ in packets], n=[len(packet) for _, packet in packets], data=data)
    part.rename(file)


def read_film(file: Path) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Return times and pictures of a film as they are decoded."""
    decoder = SceneDecoder()
    with np.load(file) as kept:
        t_ns, ends, data = kept["t_ns"].tolist(), np.cumsum(kept["n"]).tolist(), kept["data"].tobytes()
    for at_ns, begin, end in zip(t_ns, [0, *ends], ends, strict=False):
        decoder.take(at_ns, data[begin:end])
        if (decoded := decoder.image()) is not None:
            yield decoded[0] / 1e9, decoded[1]


def window(trial: TrueTrial, *, placed: bool) -> tuple[float, float]:
    """Return from when to when a trial is looked at: before the first touch until after its end."""
    touched = np.array([sum(truth.pad_force_n) > 0 for truth in trial.truths])
    begin_s = max(0.05, float(trial.t_s[np.argmax(touched)]) - _BEFORE_S)
    scorer = ruled(trial, begin_s, float(trial.t_s[-1]))[0]
    drop_s, lifted_s = scorer.time_of("drop"), scorer.time_of("lifted")
    end_s = float(trial.t_s[-1]) - 0.05
    if drop_s is not None:
        end_s = min(end_s, drop_s + _AFTER_DROP_S)
    elif lifted_s is not None and not placed:
        end_s = min(end_s, lifted_s + _AFTER_LIFTED_S)
    return begin_s, end_s


def ruled(trial: TrueTrial, begin_s: float, end_s: float) -> tuple[TrialScorer, list[float]]:
    """Return what the rule says of the truth, and when the object stood again after it had been lifted."""
    scorer, stands = TrialScorer(trial.spec.harm_m), list[float]()
    was = False
    for t_s, truth in zip(trial.t_s.tolist(), trial.truths, strict=True):
        if begin_s <= t_s <= end_s:
            scorer.take(t_s, truth, placing=False)
            if was and not truth.lift_off:
                stands.append(t_s)
            was = truth.lift_off
    scorer.close()
    return scorer, stands


def true_rule(trial: TrueTrial, begin_s: float, end_s: float) -> SceneRule:
    """Return the camera's rule, told the true poses: heights over where the object rested, as a camera has them.

    The simulated table gives by half a millimetre, so that a lift-off by its plane comes some 20 ms later.
    """
    grid = np.arange(begin_s, end_s, 0.01)

    def course(values: NDArray[np.float64]) -> Course:
        value = np.interp(grid, trial.t_s, values)
        return Course(value, np.gradient(value, grid), np.zeros(len(grid)))

    up = trial.object[:, 2, 2]
    base = trial.object[:, 2, 3]
    low = base - trial.spec.diameter_m / 2 * np.sqrt(np.clip(1 - up**2, 0, 1))
    grip = base + up * trial.spec.height_m / 2
    rest = int(np.searchsorted(trial.t_s, begin_s))
    narrow = np.array([truth.deformation_m for truth in trial.truths])
    rule = SceneRule(
        SceneCourses(
            grid,
            course(grip - grip[rest]),
            course(low - low[rest]),
            course(trial.palm[:, 2, 3] - grip),
            course(-narrow),
        ),
        trial.spec.harm_m,
    )
    rule.go()
    return rule


def true_events(rule: SceneRule) -> list[SceneEvent]:
    """Return what a rule that was told the truth says happened."""
    return [SceneEvent(one.kind, one.t_s, 0.0, one.size_m) for one in rule.scorer.events]


def ruled_layout(layout: TagLayout, sunk_mm: float, rng: np.random.Generator) -> TagLayout:
    """Return what who measures the standing object with a ruler writes into the layout.

    The simulated table gives, so that the object rests a little below it: heights are those over the table's tags.
    """
    off_mm = sunk_mm + rng.normal(0, _RULER_MM)
    thing = layout.object
    assert thing.cube is not None

    def higher(at_mm: tuple[float, float, float]) -> tuple[float, float, float]:
        return at_mm[0], at_mm[1], at_mm[2] + off_mm

    return msgspec.structs.replace(
        layout,
        object=msgspec.structs.replace(
            thing,
            cube=msgspec.structs.replace(thing.cube, at_mm=higher(thing.cube.at_mm)),
            tags=tuple(msgspec.structs.replace(tag, at_mm=higher(tag.at_mm)) for tag in thing.tags),
            grip_mm=thing.grip_mm + sunk_mm,
        ),
    )


def prove(
    plan: TrialPlan,
    lens: Lens,
    kept: Path,
    *,
    rate_hz: float,
    film: str,
    occluded: bool,
    placed: bool,
    number: int,
) -> ProvenTrial:
    """Simulate, render, encode, decode, track and score one trial, and compare; film and tags are read where kept."""
    trial = true_trial(plan)
    span = window(trial, placed=placed)
    occluders = []
    if occluded:
        lift_s = ruled(trial, *span)[0].time_of("lift_off") or span[0] + 1
        occluders = [lift_s + 0.8]
    track, layout, sunk_mm = filmed(
        trial, lens, kept, span, occluders, rate_hz=rate_hz, film=film, number=number
    )
    return compared(
        trial, track, layout, rate_hz=rate_hz, film=film, occluded=occluded, placed=placed, sunk_mm=sunk_mm
    )


def filmed(
    trial: TrueTrial,
    lens: Lens,
    kept: Path,
    span: tuple[float, float],
    passes_s: Sequence[float],
    *,
    rate_hz: float,
    film: str,
    number: int,
) -> tuple[SceneTrack, TagLayout, float]:
    """Render, encode and follow a trial; film and tags are read where kept.

    Args:
        trial: What happened.
        lens: The camera's, as calibrated.
        kept: Where the film is, or is to be.
        span: From when to when it is filmed.
        passes_s: When something passes before the object's box, for 0.2 s each time.
        rate_hz: Of the camera.
        film: Which: ``bright``, ``dim`` or ``rolling``.
        number: Seed of all noise.

    Returns:
        The poses, the layout as who measures with a ruler writes it, and how far below the table's plane the object
        rests, millimetres.
    """
    if not kept.exists():
        rendered = RenderedTrial(
            trial,
            {"bright": Film(), "dim": DIM, "rolling": ROLLING}[film],
            rate_hz=rate_hz,
            begin_s=span[0],
            end_s=span[1],
            seed=1000 + number,
            layout=folded(bench_layout(trial), np.random.default_rng(number)),
        )
        top = np.array([0, 0, trial.spec.height_m])
        rendered.occluders = tuple(
            Occluder(at_s, at_s + 0.2, rendered.seen_at("object", top, at_s), (80.0, 110.0))
            for at_s in passes_s
        )
        write_film(kept, rendered.pictures(), (lens.width, lens.height), rate_hz)
    sunk_mm = float(1000 * trial.object[np.searchsorted(trial.t_s, span[0]), 2, 3])
    layout = ruled_layout(bench_layout(trial), sunk_mm, np.random.default_rng(500 + number))
    return follow_bodies(found_tags(kept, lens, layout), lens, layout), layout, sunk_mm


def found_tags(film: Path, lens: Lens, layout: TagLayout) -> SceneSightings:
    """Return the tags in a film, found or as they are kept; take the file away when the search for tags has changed."""
    kept = film.with_suffix(".tags.json")
    if not kept.exists():
        seen = sight_tags(read_film(film), lens, layout)
        tags = [{str(tag): corners.tolist() for tag, corners in one.items()} for one in seen.corners]
        kept.write_bytes(msgspec.json.encode((seen.t_s, tags)))
    t_s, tags = msgspec.json.decode(kept.read_bytes())
    return SceneSightings(t_s, [{int(tag): np.array(one[tag]) for tag in one} for one in tags])


def compared(
    trial: TrueTrial,
    track: SceneTrack,
    layout: TagLayout,
    *,
    rate_hz: float,
    film: str,
    occluded: bool,
    placed: bool,
    sunk_mm: float,
) -> ProvenTrial:
    """Score a trial that was tracked, and compare with the truth."""
    begin_s, end_s = window(trial, placed=placed)
    scorer, stands = ruled(trial, begin_s, end_s)
    outcome = score_scene(track, layout, harm_m=trial.spec.harm_m)
    track = righted(track, layout, begin_s=float(track.t_s[0]))
    true = true_events(true_rule(trial, begin_s, end_s))
    lifted_s = scorer.time_of("lifted")
    put = [
        t_s for t_s in stands if lifted_s is not None and t_s > lifted_s and scorer.time_of("drop") is None
    ]
    put_mm = None
    if put:
        base = trial.object[np.searchsorted(trial.t_s, end_s) - 1, :, 3]
        true.append(SceneEvent("put_down", put[-1], 0.0, float(np.hypot(*base[:2]))))
        mine = [one for one in outcome.events if one.kind == "put_down"]
        put_mm = 1000 * (mine[0].size_m - true[-1].size_m) if mine else None
    return ProvenTrial(
        name=name_of(trial.plan),
        rate_hz=rate_hz,
        film=film,
        occluded=occluded,
        placed=placed,
        n_pictures=len(track.t_s),
        object_mm=split_off(
            place_off_mm(trial, track, "object", np.array([0, 0, layout.object.grip_mm / 1000]), sunk_mm)
        ),
        hand_mm=split_off(place_off_mm(trial, track, "hand", np.array(WRIST_MM) / 1000, 0.0)),
        claimed_mm=(outcome.along_mm, outcome.across_mm),
        slip_mm=_slip_off(trial, track, layout, scorer, (begin_s, end_s)),
        width_mm=_width_off(trial, track, layout),
        seen=(outcome.seen, outcome.placed, outcome.hand_seen),
        true=tuple(sorted(true, key=lambda one: one.t_s)),
        measured=outcome.events,
        put_down_mm=put_mm,
    )


def place_off_mm(
    trial: TrueTrial, track: SceneTrack, name: str, at_m: NDArray[np.float64], sunk_mm: float
) -> NDArray[np.float64]:
    """Return how far a point is measured from where it is, float64 (n, 3); NaN in pictures that do not place it."""
    pose = track.object if name == "object" else track.hand
    measured, _ = pose.point(at_m)
    true = np.array([world_pose(trial, name, float(t_s)) for t_s in track.t_s])
    left = 1000 * (measured - true[:, :, :3] @ (at_m - (0, 0, sunk_mm / 1000)) - true[:, :, 3])
    return np.where(is_placed(pose, at_m)[:, None], left, np.nan)


def split_off(left: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the root mean square of errors (n, 3): in space, along the view, across it."""
    along = left @ camera_pose()[2, :3]
    whole, deep = float(np.nanmean((left**2).sum(1))), float(np.nanmean(along**2))
    return float(np.sqrt(whole)), float(np.sqrt(deep)), float(np.sqrt((whole - deep) / 2))


def _slip_off(
    trial: TrueTrial, track: SceneTrack, layout: TagLayout, scorer: TrialScorer, span: tuple[float, float]
) -> float:
    courses = scene_courses(track, layout, begin_s=span[0], end_s=span[1])
    lift_s = scorer.time_of("lift_off")
    if lift_s is None:
        return float("nan")
    grip = trial.object[:, 2, 2] * layout.object.grip_mm / 1000 + trial.object[:, 2, 3]
    true = np.interp(courses.t_s, trial.t_s, trial.palm[:, 2, 3] - grip)
    until = scorer.time_of("drop") or span[1]
    aloft = np.array([truth.lift_off for truth in trial.truths])[
        np.clip(np.searchsorted(trial.t_s, courses.t_s), 0, len(trial.t_s) - 1)
    ]
    off = aloft & (courses.t_s >= lift_s) & (courses.t_s <= until)
    left = courses.slip.value[off] - true[off]
    before = (courses.t_s > lift_s - 0.1) & (courses.t_s <= lift_s)
    left = left - float(np.mean(courses.slip.value[before] - true[before]))
    return float(1000 * np.sqrt(np.nanmean(left**2)))


def _width_off(trial: TrueTrial, track: SceneTrack, layout: TagLayout) -> float:
    courses = scene_courses(track, layout, begin_s=float(track.t_s[0]), end_s=float(track.t_s[-1]))
    true = -np.interp(courses.t_s, trial.t_s, [truth.deformation_m for truth in trial.truths])
    return float(1000 * np.sqrt(np.nanmean((courses.width.value - true) ** 2)))


def name_of(plan: TrialPlan) -> str:
    """Return what to call a trial."""
    slippery = "" if plan.friction is None else f" µ={plan.friction:g}"
    return f"{plan.object}{slippery} {plan.condition} {plan.seed}"


def calibrated(folder: Path) -> Lens:
    """Return the lens as the ChArUco calibration finds it, from rendered pictures; kept in the folder."""
    file = folder / "lens.json"
    if not file.exists():
        calibration = LensCalibration(LENS.width, LENS.height)
        for image in board_pictures(Film(), n=40):
            calibration.take(image)
        save_lens(file, calibration.solve())
    return load_lens(file)


def main() -> None:
    """Go through the design; what is in the file already is passed over."""
    out, seed = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    lens = calibrated(out.parent)
    lines = out.read_bytes().splitlines() if out.exists() else []
    done = {msgspec.json.decode(line, type=ProvenTrial).name for line in lines}
    # Those that slip first: they are the shortest, too.
    for number, (plan, rate_hz, film, occluded, placed) in sorted(
        enumerate(design(seed)), key=lambda one: one[1][0].friction or 1.0
    ):
        if name_of(plan) in done:
            continue
        found: Any = prove(
            plan,
            lens,
            out.with_name(f"film-{number}.npz" if seed == 1 else f"film-{seed}-{number}.npz"),
            rate_hz=rate_hz,
            film=film,
            occluded=occluded,
            placed=placed,
            number=number + 100 * (seed - 1),
        )
        with out.open("ab") as file:
            file.write(msgspec.json.encode(found) + b"\n")


if __name__ == "__main__":
    main()
