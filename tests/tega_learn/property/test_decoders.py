"""Properties of learned decoders: chunks, gains, the order of channels, a stage that only rises, files."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

pytest.importorskip("sklearn", reason="scikit-learn is not installed")

from tega.errors import CalibrationError, ConfigError, InvalidValueError, ShapeError, TegaError
from tega.setup.contract import check_stage
from tega.stages import MuscleSetup
from tega.stages.decoders import RulesDecoder, RulesOptions
from tega_learn.block_features import block_features
from tega_learn.compare import Log, compare
from tega_learn.decoders import FEATURES, LearnedDecoder, Model, ProportionalDecoder, fit, load_model
from tega_learn.stage import LearnedOptions, LearnedStage, ProportionalOptions, ProportionalStage

RATE_HZ, TAU = 1000.0, 100


def squeezes(
    seed: int = 1, channels: int = 3, seconds: int = 24
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return noise as strong as a closure that rises and falls, and the closure."""
    rng = np.random.default_rng(seed)
    corners = np.arange(0, seconds + 1, 2)
    heights = np.where(corners % 4 == 0, 0.0, rng.uniform(0.3, 1.0, len(corners)))
    closure = np.interp(np.arange(seconds * 1000) / 1000, corners, heights)
    gains = rng.uniform(20, 200, channels)
    return rng.normal(size=(len(closure), channels)) * (2 + gains * closure[:, None]) + 500, closure


def steps(seed: int, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return noise of so many times four efforts that are held, and the closure."""
    closure = np.tile(np.repeat([0.0, 1.0, 0.5, 0.0], 1500), n)
    return np.random.default_rng(seed).normal(size=(len(closure), 3)) * (5 + 90 * closure[:, None]), closure


@cache
def fitted(model: str = "ridge", features: tuple[str, ...] = tuple(FEATURES)) -> LearnedDecoder:
    emg, closure = squeezes(seconds=12)
    chosen: Any = model
    return fit(emg, closure, rate_hz=RATE_HZ, tau=TAU, model=chosen, features=features)


def fresh(model: str = "ridge") -> LearnedDecoder:
    return LearnedDecoder(fitted(model).model)


@pytest.mark.parametrize(
    "model",
    [
        "ridge",
        pytest.param("kernel", marks=pytest.mark.slow),
        pytest.param("huber", marks=pytest.mark.deep),  # linear as the first, and slow to fit
    ],
)
@settings(max_examples=15)
@given(cuts=st.lists(st.integers(0, 2000), max_size=8), holes=st.lists(st.integers(0, 1999), max_size=60))
def test_chunks_do_not_matter_to_the_last_bit(model: str, cuts: list[int], holes: list[int]) -> None:
    emg = squeezes(seed=2, seconds=4)[0][:2000].copy()
    emg[holes, 1] = np.nan
    emg[1000:1200, 2] = np.nan
    whole = fresh(model)
    whole.process(emg)
    parts = fresh(model)
    reported = []
    for part in np.split(emg, sorted(cuts)):
        parts.process(part)
        reported += [msgspec.structs.replace(one, end=0) for one in parts.decoded]
    assert repr(reported) == repr([msgspec.structs.replace(one, end=0) for one in whole.decoded])


@pytest.mark.parametrize("order", [[1, 2, 0], [2, 1, 0]])
def test_the_order_of_channels_and_their_gains_do_not_matter_if_they_are_the_same(order: list[int]) -> None:
    emg, closure = squeezes(seconds=12)
    other_emg = (emg * [1e-3, 1e3, 0.7])[:, order]
    other = fit(other_emg, closure, rate_hz=RATE_HZ, tau=TAU)
    same = fit(emg, closure, rate_hz=RATE_HZ, tau=TAU)
    np.testing.assert_allclose(other.process(other_emg), same.process(emg), atol=1e-6)


@given(efforts=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=50))
def test_the_closure_never_falls_as_the_effort_rises(efforts: list[float]) -> None:
    decoder = fresh()
    closures = [decoder.closure_of(effort) for effort in sorted(efforts)]
    assert closures == sorted(closures)
    assert 0 <= closures[0] <= closures[-1] <= 1


@given(n=st.integers(4, 200), seed=st.integers(0, 99))
def test_shares_are_shares_and_features_do_not_depend_on_gain(n: int, seed: int) -> None:
    x = np.random.default_rng(seed).normal(size=(n, 2))
    for name in ("ZC", "SSC", "AR"):
        np.testing.assert_allclose(
            block_features(x * 8, (name,)), block_features(x, (name,)), rtol=1e-6, atol=1e-9
        )
    assert (block_features(x, ("ZC", "SSC")) <= 1).all()
    np.testing.assert_allclose(block_features(x, ("MAV",)), np.abs(x).mean(axis=0))
    np.testing.assert_allclose(block_features(x, ("LOGVAR",)), x.var(axis=0))
    np.testing.assert_allclose(block_features(x, ("WL",)), np.abs(np.diff(x, axis=0)).mean(axis=0))


def test_autoregression_finds_the_coefficients_of_a_process() -> None:
    rng = np.random.default_rng(3)
    x = np.zeros(50_000)
    for n in range(2, len(x)):
        x[n] = 1.2 * x[n - 1] - 0.6 * x[n - 2] + rng.normal()
    np.testing.assert_allclose(block_features(x[:, None], ("AR",)), [1.2, -0.6, 0, 0], atol=0.03)


@pytest.mark.parametrize("value", [np.nan, 1023.0])
def test_missing_channels_and_an_amplifier_at_its_limit_hold_and_are_not_believed(value: float) -> None:
    emg, _ = squeezes(seed=4, seconds=6)
    decoder = fresh()
    before = decoder.process(emg[:3000])
    gone = emg[3000:5000].copy()
    gone[:, 1] = value
    held = decoder.process(gone)
    assert (held == before[-1]).all()
    assert decoder.held.all()
    assert (decoder.confidence == 0).all()
    assert all(one.channels == (0, 0, 0) for one in decoder.decoded)
    decoder.process(emg[5000:6000])
    assert decoder.held.tolist() == [True] + [False] * 9
    decoder.process(500 + (emg[3000:5000] - 500) * 1e4)  # like nothing known
    assert decoder.held[3:].all()
    assert (decoder.confidence[3:] <= 0.5).all()


def test_the_settings_state_which_share_is_held_at_most(options: LearnedOptions) -> None:
    assert options.model is not None
    model = load_model(options.model)
    emg, shares = steps(7, 6)[0], []
    for reject in (0.0, 0.05, 0.2):
        decoder = LearnedDecoder(model.rejecting(reject, "m.json"))
        decoder.process(emg)
        shares.append(float(decoder.held.mean()))
        assert shares[-1] <= reject + 0.02
        stage = LearnedStage(setup(), msgspec.structs.replace(options, reject=reject))
        intents = stage.decode(emg, np.arange(1, len(emg) + 1) * 1_000_000)
        assert [intent.closure for intent in intents] == [one.closure for one in decoder.decoded]
    assert shares == sorted(shares)
    assert shares[-1] > shares[0]


def test_a_model_that_does_not_know_its_share_runs_and_is_refused_one(
    options: LearnedOptions, tmp_path: Path
) -> None:
    assert options.model is not None
    before = msgspec.structs.replace(load_model(options.model), novelty=())
    LearnedDecoder(before).save(tmp_path / "old.json")
    old = msgspec.structs.replace(options, model=tmp_path / "old.json")
    LearnedStage(setup(), old)
    with pytest.raises(CalibrationError, match=r"old\.json: does not know which share"):
        LearnedStage(setup(), msgspec.structs.replace(old, reject=0.05))


def test_a_model_is_a_file_that_gives_the_same(tmp_path: Path) -> None:
    emg, _ = squeezes(seed=5, seconds=4)
    for model in ("ridge", "kernel"):
        decoder = fresh(model)
        decoder.save(tmp_path / "model.json")
        again = LearnedDecoder.load(tmp_path / "model.json")
        assert again.model == decoder.model
        assert again.process(emg).tobytes() == decoder.process(emg).tobytes()
    (tmp_path / "model.json").write_bytes(b"{}")
    with pytest.raises(CalibrationError, match="no decoder's model"):
        load_model(tmp_path / "model.json")


@given(
    field=st.sampled_from(Model.__struct_fields__),
    value=st.sampled_from([None, "x", -1, [], {}, 1e308, [1.0]]),
)
def test_a_changed_model_is_refused_or_runs(
    field: str, value: Any, tmp_path_factory: pytest.TempPathFactory
) -> None:
    tree = msgspec.to_builtins(fitted().model) | {field: value}
    path = tmp_path_factory.mktemp("model") / "m.json"
    path.write_bytes(msgspec.json.encode(tree))
    try:
        decoder = LearnedDecoder.load(path)
        n = decoder.channels
        decoder.process(np.random.default_rng(1).normal(size=(300, n)))
    except TegaError:
        pass


GOOD, WANTED = squeezes(seconds=12)


@pytest.mark.parametrize(
    ("emg", "target", "text"),
    [
        (GOOD[:5000], WANTED[:5000], "too short"),
        (GOOD, np.zeros(len(GOOD)), "one class"),
        (GOOD, np.ones(len(GOOD)), "one class"),
        (np.clip(GOOD, 490, 510), WANTED, "clipped"),
        (GOOD, WANTED[:-7], "one target a sample"),
        (GOOD, np.tile([0.0, 1.0], len(GOOD) // 2), "do not go together"),
        (GOOD, np.repeat(np.random.default_rng(1).integers(0, 2, 60) * 1.0, 200), "do not go together"),
        (np.where(np.arange(len(GOOD))[:, None] == 9, np.nan, GOOD), WANTED, "no numbers"),
        (GOOD * [1, 0, 1], WANTED, "never moves"),
    ],
)
def test_a_log_that_teaches_nothing_is_refused(emg: Any, target: Any, text: str) -> None:
    with pytest.raises(TegaError, match=text) as refused:
        fit(emg, target, rate_hz=RATE_HZ, tau=TAU)
    assert getattr(refused.value, "hint", "")


@pytest.mark.parametrize(
    "options", [{"features": ("X",)}, {"model": "forest"}, {"tau": 2}, {"rate_hz": 50.0}]
)
def test_options_that_cannot_be_used_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InvalidValueError):
        fit(GOOD, WANTED, **({"rate_hz": RATE_HZ, "tau": TAU} | options))


def test_recalibration_takes_out_other_gains() -> None:
    emg, closure = squeezes(seconds=40)
    decoder = fit(emg[:20_000], closure[:20_000], rate_hz=RATE_HZ, tau=TAU)
    moved = 500 + (emg[20_000:] - 500) * [0.3, 3.0, 0.5]
    renewed = decoder.recalibrated(moved[:10_000], closure[20_000:30_000])
    wanted = closure[30_000:].reshape(-1, TAU).mean(axis=1)
    decoder.restart()
    before = np.abs(decoder.process(moved[10_000:]) - wanted).mean()
    after = np.abs(renewed.process(moved[10_000:]) - wanted).mean()
    assert after < 0.12
    assert after < before
    with pytest.raises(CalibrationError, match="too short"):
        decoder.recalibrated(moved[:500], closure[:500])


def ring(seed: int, turned: int = 0, gain: float = 1.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rest and fists of a ring of eight electrodes, of which three lie over the muscles that work."""
    rng = np.random.default_rng(seed)
    closure = np.tile(np.repeat([0.0, 1.0], 1500), 5)
    works = gain * np.roll([90.0, 40.0, 5.0, 3.0, 2.0, 2.0, 4.0, 30.0], turned)
    return rng.normal(size=(len(closure), 8)) * (3 + works * closure[:, None]), closure


@pytest.mark.parametrize(("turned", "gain"), [(-1, 2.0), (0, 0.5), (1, 1.0), (1, 0.5)])
def test_open_and_closed_are_told_apart_on_a_ring_that_was_turned(turned: int, gain: float) -> None:
    emg, closure = ring(2, turned, gain)
    decoder = LearnedDecoder(of_two().model)
    reported = decoder.process(emg)
    wanted = closure.reshape(-1, TAU).mean(axis=1)
    assert ((reported >= 0.5) == (wanted >= 0.5)).mean() >= 0.9


@cache
def of_two() -> LearnedDecoder:
    emg, closure = ring(1)
    return fit(emg, closure, rate_hz=RATE_HZ, tau=TAU)


def setup(**changes: Any) -> MuscleSetup:
    return MuscleSetup("raw", RATE_HZ, TAU, ("a", "b", "c"), (80.0,) * 3, "live")._replace(**changes)


@pytest.fixture(scope="module")
def options(tmp_path_factory: pytest.TempPathFactory) -> LearnedOptions:
    emg, closure = steps(1, 4)
    file = tmp_path_factory.mktemp("model") / "m.json"
    fit(emg, closure, rate_hz=RATE_HZ, tau=TAU, channels=("a", "b", "c"), person="p01").save(file)
    return LearnedOptions(model=file, person="p01")


def test_both_stages_keep_the_contract(options: LearnedOptions) -> None:
    check_stage(LearnedStage, options)
    check_stage(ProportionalStage, ProportionalOptions(channel=2, opening=3))


def test_a_model_is_refused_where_it_does_not_fit(options: LearnedOptions, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="names no model"):
        LearnedStage(setup(), LearnedOptions())
    with pytest.raises(CalibrationError, match="cannot be read"):
        LearnedStage(setup(), LearnedOptions(model=tmp_path / "none.json"))
    for changed, text in (
        ({"kind": "envelope"}, "kind"),
        ({"rate_hz": 500.0}, "samples/s"),
        ({"channels": ("a", "c", "b")}, "channels"),
    ):
        with pytest.raises(CalibrationError, match=text):
            LearnedStage(setup(**changed), options)
    with pytest.raises(CalibrationError, match="person"):
        LearnedStage(setup(), msgspec.structs.replace(options, person="p02"))


def test_another_rate_while_running_is_not_believed(options: LearnedOptions) -> None:
    stage = LearnedStage(setup(), options)
    emg = np.random.default_rng(2).normal(size=(8000, 3)) * 50
    times_ns = np.arange(1, 8001) * 500_000  # twice as fast
    intents = stage.decode(emg, times_ns)
    assert all(any(intent.channels) for intent in intents[:30])
    assert not any(any(intent.channels) for intent in intents[30:])
    assert len({intent.closure for intent in intents[30:]}) == 1


@pytest.mark.parametrize("cuts", [[], [0, 30, 60, 1450, 1700, 1850, 1850, 1901, 3001]])
def test_the_band_of_the_rules_makes_no_effort_of_an_offset_that_comes_or_jumps(cuts: list[int]) -> None:
    samples = np.random.default_rng(1).normal(2048, 5, (4000, 3))
    samples[:50, 0] = samples[1500:1900] = np.nan
    samples[1900:] -= 1500
    samples[3000, 1] = 1e308
    decoder = RulesDecoder(setup(), RulesOptions(before="band"))
    parts = zip(np.split(samples, cuts), np.split(np.arange(4000), cuts), strict=True)
    channels = [one.channels for part in parts for one in decoder.decode(*part)]
    assert (len(channels), max(map(max, channels))) == (40, 1)
    assert channels[-8:] == [(1, 1, 1)] * 8


def test_proportional_is_open_at_rest_and_closed_at_full() -> None:
    decoder = ProportionalDecoder(200, [1.0, 1.0], tau=20, kind="envelope", channels=(0, 1))
    assert decoder.process(np.tile([0.05, 0.0], (400, 1)))[-1] == 0
    assert decoder.process(np.tile([1.0, 0.0], (400, 1)))[-1] == 1
    assert decoder.process(np.tile([1.0, 1.0], (400, 1)))[-1] == 0
    with pytest.raises(InvalidValueError):
        ProportionalDecoder(200, [1.0], tau=20, channels=(0, 1))
    with pytest.raises(ShapeError):
        ProportionalDecoder(200, [0.0], tau=20)


def test_a_trembling_effort_is_less_sure_than_a_steady_one() -> None:
    rng = np.random.default_rng(1)
    steady, trembling = (
        ProportionalDecoder(200, [1.0], tau=20, kind="envelope", smoothing_s=0.05) for _ in range(2)
    )
    effort = np.full((4000, 1), 0.5)
    steady.process(effort)
    assert steady.decoded[-1].confidence == 1.0
    # Every third closure is off by more than a level, and says so.
    trembles = np.repeat(rng.normal(0.5, 0.2, 1000).clip(0, 1), 20)[:, np.newaxis]
    closure = trembling.process(trembles)
    sure = np.array([one.confidence for one in trembling.decoded])[20:]
    right = np.abs(closure[20:] - (0.5 - 0.1) / 0.7) <= 0.25
    assert 0.5 < right.mean() < 0.85
    assert sure.mean() == pytest.approx(right.mean(), abs=0.1)


def test_an_unsure_proportional_closure_is_held_where_the_settings_say_so() -> None:
    rng = np.random.default_rng(2)
    shares = np.repeat(np.concatenate([np.full(100, 0.5), rng.choice([0.02, 1.0], 100)]), 100)
    emg = rng.normal(size=(len(shares), 3)) * shares[:, np.newaxis] * 100
    times_ns = np.arange(1, len(emg) + 1) * 1_000_000
    plain, held = (
        ProportionalStage(setup(), ProportionalOptions(smoothing_s=0.05, hold_below=least)).decode(
            emg, times_ns
        )
        for least in (0.0, 0.8)
    )
    assert [one.confidence for one in plain] == [one.confidence for one in held]
    assert np.abs(np.diff([one.closure for one in plain[120:]])).mean() > 0.1
    unsure = [k for k in range(1, len(held)) if (held[k].confidence or 0) < 0.8]
    assert len(unsure) > 50
    assert all(held[k].closure == held[k - 1].closure for k in unsure)


def test_logs_of_other_sources_are_not_compared() -> None:
    log = Log("a", GOOD, WANTED, RATE_HZ)
    with pytest.raises(InvalidValueError, match="one source"):
        compare(log, log._replace(rate_hz=500.0), ["rules"])
    reported = compare(log, log, ["rules", "proportional", "learned"])
    assert [one.decoder for one in reported] == ["rules", "proportional", "learned"]
    assert reported[2].figures.rank_correlation > 0.9
