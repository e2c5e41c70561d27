"""The masking sound: pink, at its level, without a click, and the same in every condition of a session."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.processes import until
from reference.study_bench import LiftingBench, ScriptedDesk, quick_study
from tega.config import load_config
from tega.errors import ConfigError, DeviceUnavailableError, MissingExtraError
from tega_emulators.sound_port import SoundPort
from tega_study.journal import events_path, read_events
from tega_study.lead.session import lead_session
from tega_study.masking_settings import MaskingSection
from tega_study.masking_sound import BAND_HZ, RATE_HZ, MaskingSound, pink_loop
from tega_study.state import SessionState

QUIET = MaskingSection(level_dbfs=-30.0)


@pytest.fixture
def port() -> Iterator[SoundPort]:
    """Stand in for PortAudio, with a loudspeaker."""
    made = SoundPort()
    with made.installed():
        yield made


def test_the_noise_is_pink_within_its_band_and_its_end_fits_its_start() -> None:
    loop = pink_loop()
    assert np.sqrt((loop.astype(np.float64) ** 2).mean()) == pytest.approx(1, abs=1e-4)
    power = np.abs(np.fft.rfft(loop)) ** 2
    hz = np.fft.rfftfreq(len(loop), 1 / RATE_HZ)
    octaves = [power[(hz >= low) & (hz < 2 * low)].sum() for low in (62.5 * 2.0 ** np.arange(7))]
    # Of pink noise every octave has the same power.
    assert np.ptp(10 * np.log10(octaves)) < 0.2
    outside = (hz < BAND_HZ[0]) | (hz > BAND_HZ[1])
    assert power[outside].sum() < 1e-9 * power.sum()
    step = np.abs(np.diff(loop))
    assert abs(loop[0] - loop[-1]) <= step.max()
    assert np.abs(loop).max() * 10 ** (-14 / 20) < 1.05, "the loudest level hardly clips"


@pytest.mark.parametrize("level_dbfs", [-60.0, -30.0, -14.0])
def test_it_rises_to_its_level_and_falls_to_silence_without_a_click(level_dbfs: float) -> None:
    sound = MaskingSound(MaskingSection(level_dbfs=level_dbfs))
    made = np.concatenate([sound.render(480) for _ in range(1200)])
    settled = made[RATE_HZ:].astype(np.float64)
    assert 20 * np.log10(np.sqrt((settled**2).mean())) == pytest.approx(level_dbfs, abs=0.2)
    assert (made[:, 0] == made[:, 1]).all()
    first = np.sqrt((made[:480].astype(np.float64) ** 2).mean())
    assert first < 0.05 * np.sqrt((settled**2).mean())
    sound._fading = True
    end = np.concatenate([sound.render(480) for _ in range(60)])
    assert np.abs(end[-480:]).max() == 0
    assert np.sqrt((end[-5000:-4800] ** 2).mean()) <= np.sqrt((end[:2000] ** 2).mean())


def test_it_plays_through_portaudio_and_ends_in_silence(port: SoundPort) -> None:
    with MaskingSound(QUIET) as sound:
        until(lambda: len(port.played) > 30)
        assert sound.playing
    assert not sound.playing
    played = np.concatenate(port.played)
    assert np.abs(played).max() > 0
    assert np.abs(played[-20:]).max() < 0.01


def test_without_a_loudspeaker_package_or_level_it_says_what_to_do(
    port: SoundPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    port.present = False
    with pytest.raises(DeviceUnavailableError, match=r"does not open.*set masking\.output"):
        MaskingSound(QUIET).open()
    with pytest.raises(DeviceUnavailableError, match=r"masking\.level_dbfs is not set"):
        MaskingSound(MaskingSection())
    with pytest.raises(ConfigError, match=r"masking\.level_dbfs"):
        load_config(None, environ={}, sets=["masking.level_dbfs=0"])
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(MissingExtraError, match=r"tega\[sound\]"):
        MaskingSound(QUIET).open()


@pytest.mark.slow
def test_a_session_says_what_masks_it_and_stops_where_that_has_gone(port: SoundPort, tmp_path: Path) -> None:
    quick_study(tmp_path)

    def lead(**options: Any) -> SessionState:
        return lead_session(
            tmp_path, "p01", LiftingBench(), ScriptedDesk(), time_scale=0.01, auto=True, **options
        )

    def notes() -> list[str]:
        return [event.text for event in read_events(events_path(tmp_path, "p01")) if event.kind == "note"]

    with MaskingSound(QUIET) as sound:
        until(lambda: sound.playing)
        lead(trials=1, masking=sound)
        assert "masking sound: pink noise at -30 dB of full scale (RMS) on the system output" in notes()
        port.present = False
        until(lambda: not sound.playing)
        with pytest.raises(DeviceUnavailableError, match="the masking sound stopped"):
            lead(masking=sound)
    assert any("the masking sound stopped" in note for note in notes())
    assert lead().next is None
    assert "masking sound: none" in notes()
