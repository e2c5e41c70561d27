"""Define the sections of the simulated person's parameter file, where units, ranges and sources stand."""

from __future__ import annotations

import msgspec


class _PersonSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    pass


class BodySection(_PersonSection, frozen=True):
    """Age, and how reactions slow with it."""

    age_years: float
    rt_per_year_ms: float
    rt_correlation: float


class Vision(_PersonSection, frozen=True):
    """Sight: what can be seen, and how late."""

    rt_ms: float
    rt_sigma_ms: float
    rt_tau_ms: float
    rt_floor_ms: float
    choice_ms: float
    motion_c: float
    motion_floor_deg_s: float
    motion_leak_s: float
    distance_m: float
    gaze_grasp: float
    gaze_transport: float
    look_s: float
    deform_theta: float
    deform_log_sd: float
    contact_p: float
    pose_sd: float
    delay_ms: float


class VestSection(_PersonSection, frozen=True):
    """Sense of the vest on the torso: link, motors, skin, attention."""

    rt_ms: float
    rt_sigma_ms: float
    rt_tau_ms: float
    dual_ms: float
    link_ms: float
    link_sd_ms: float
    link_max_ms: float
    dead_ms: float
    lag_up_ms: float
    lag_down_ms: float
    start_level: float
    exponent: float
    spread: float
    threshold: float
    threshold_log_sd: float
    lapse: float
    weber: float
    adapt_gain: float
    adapt_s: float
    panel_swap: float
    compare_s: float
    compare_every_s: float
    compare_sds: float


class GripSection(_PersonSection, frozen=True):
    """Guesses, costs and pace of the decisions."""

    need: float
    need_sd: float
    harm: float
    harm_sd: float
    belief_floor_sd: float
    between_sd: float
    carry_over: float
    quiet_s: float
    quiet_sd: float
    harm_cost: float
    effort_cost: float
    gain_to_act: float
    refractory_ms: float
    direct_sd: float
    closing_step_s: float
    closing_wait_s: float
    contact_wait_s: float
    closure_sd: float
    closure_drift: float
    line_intercept_sd: float
    line_slope_sd: float
    line_slope_min: float


class MotorSection(_PersonSection, frozen=True):
    """Muscles: from a level in mind to excitation."""

    aim_sd: float
    aim_floor: float
    lag_ms: float
    slack_per_s: float
    slack_floor: float
    slack_above: float
    effort_sd: float
    effort_wait_s: float
    felt_delay_ms: float
    rise_ms: float
    fall_ms: float
    calibration_effort: float
    level_one: float
    level_five: float


class ForearmSection(_PersonSection, frozen=True):
    """Movements of the hand as a whole."""

    back_m: float
    reach_s: float
    settle_s: float
    lift_m: float
    lift_s: float
    hold_s: float
    place_s: float
    release_s: float
    missed_m: float
    attempts: float


class Emg(_PersonSection, frozen=True):
    """Muscles, electrodes and amplifier."""

    ecr_uv: float
    fcu_uv: float
    fds_uv: float
    spectrum_low_hz: float
    spectrum_high_hz: float
    power: float
    gain_sd: float
    posture_sd: float
    common: float
    drive_corner_hz: float
    drive_floor: float
    drive_share: float
    rest_share: float
    crosstalk_flexors: float
    crosstalk_extensor: float
    white_uv: float
    mains_uv: float
    mains_hz: float
    artefact_hz: float
    artefact_moving: float
    artefact_low_uv: float
    artefact_high_uv: float
    artefact_decay_ms: float
    offset_uv: float
    drift_uv: float
    fatigue_per_s: float
    recovery_per_s: float
    recovery_at_rest: float
    fatigue_gain: float
    fatigue_slowing: float
