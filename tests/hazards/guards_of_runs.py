"""The guards of how a run ends, of limits, inputs and people, and of files."""

from __future__ import annotations

from typing import Final

from hazards.guards import Guard

OF_RUNS: Final = (
    Guard(
        "a run removes the results of an earlier one",
        "together/test_replay::the_results_of_an_earlier_run_are_kept_and_told",
        "        path.rename(kept / path.name)  # a link is moved, not what it leads to",
        "        path.unlink()",
    ),
    Guard(
        "a closed terminal ends the program at once",
        "tega/unit/test_hand_guard::a_closed_terminal_lets_go_of_the_hand",
        '("SIGTERM", "SIGHUP")',
        '("SIGTERM",)',
    ),
    Guard(
        "signals are not taken",
        "hazards/test_stop::a_signal_stops_and_leaves_all_safe",
        "            self._old[number] = signal.signal(number, self._on_signal)",
    ),
    Guard(
        "every Ctrl-C cuts in",
        "hazards/test_stop::impatience_stops_as_well",
        "        elif not self._interrupted and time.monotonic() - self._requested_s > _PATIENCE_S:",
        "        else:",
    ),
    Guard("keys are not read", "hazards/test_stop::a_key_stops", "        stop.also(pressed)\n", ""),
    Guard(
        "the set time is not kept",
        "hazards/test_stop::the_set_time_stops",
        "                if duration_ns is not None and t_ns >= duration_ns:",
    ),
    Guard(
        "a mistake in the program leaves everything as it is",
        "hazards/test_stop::an_error_in_the_program_stops",
        '            for problem in self._leave(last_ns, f"stopped: {_text(error)}"):\n',
        "            for problem in []:\n",
    ),
    Guard(
        "no limit before the vest",
        "tega/property/test_safety::a_driver_s_link_is_never_told_more_than_the_limit",
        "allowed = self.budget.allow(time.monotonic_ns(), frame.x40())",
        "allowed = frame.x40()",
    ),
    Guard(
        "no heat of motors",
        "tega/property/test_safety::no_input_drives_a_motor_beyond_ceiling_heat_or_dose",
        "np.sqrt(np.minimum(np.maximum(squared, 0.0), 1.0))",
        "np.ones(40)",
    ),
    Guard(
        "the hand's own share of torque is not passed on",
        "tega/property/test_safety::no_frames_of_a_hand_lead_to_a_torque_beyond_its_limits",
        "            controller._native,",
        "            type(controller)()._native,",
    ),
    Guard(
        "arming waits for nothing",
        "tega/property/test_safety::no_sequence_of_events_leads_to_active_without_every_condition",
        " and clear",
    ),
    Guard(
        "a level passes in every state",
        "tega/property/test_safety::only_an_active_run_passes_a_level_on",
        '        elif state != "hold":\n            self._level = _OPEN',
        "        else:\n            self._level = wanted",
    ),
    Guard(
        "a finger's joint is taken for the wrist",
        "tega/unit/test_hololens::no_byte_of_a_packet_but_the_wrist_s_changes_a_pose",
        "_WRIST_NUMBER: Final = 1\n",
        "_WRIST_NUMBER: Final = 10\n",
    ),
    Guard(
        "names in a file become paths as they are",
        "together/test_hostile_names::no_verb_on_a_recording_writes_elsewhere",
        "    if not _PLAIN.fullmatch(name) or",
        "    if False and",
    ),
    Guard(
        "electrodes that are off keep their vote",
        "hazards/test_lost_muscles::lost_muscles_hold_the_level_then_open_the_hand_and_steer_again[at the limit]",
        "        changed, passed = self._core.take(np.ascontiguousarray(as_array(samples), np.float64))",
        "        changed, passed = False, None",
    ),
    Guard(
        "one electrode that is off keeps its vote",
        "hazards/test_lost_muscles::one_electrode_that_is_off_has_no_vote_and_the_others_go_on",
        "        changed, passed = self._core.take(np.ascontiguousarray(as_array(samples), np.float64))",
        "        changed, passed = False, None",
    ),
    Guard(
        "the level that a fault has made is what the run holds",
        "tega/unit/test_emg_votes::a_fault_of_every_channel_keeps_the_level_before_it",
        "            intent = replace(intent, level=before.level, closure=before.closure)",
    ),
    Guard(
        "a tracker's jump is believed",
        "tega/unit/test_arm::a_jump_is_believed_once_the_hand_was_lost",
        '            return f"{JUMPED} {1e3 * step_m:.0f} mm"',
        '            return ""',
    ),
    Guard(
        "a dim picture keeps its vote",
        "tega/unit/test_repeats::a_dark_camera_has_no_vote_until_half_a_second_after_the_last_dark_picture",
        "    if share < _DARK_SHARE:",
    ),
    Guard(
        "a torn picture keeps its vote",
        "tega/unit/test_repeats::a_torn_picture_is_left_out_and_a_camera_that_tears_them_has_no_vote",
        "    if of_one_colour or any(map(operator.eq, now, before)):",
    ),
    Guard(
        "the same picture again counts as a new one",
        "tega/unit/test_repeats::a_frozen_camera_has_no_vote_until_a_picture_differs",
        "if self.live and self._n_equal >= STUCK_FRAMES:",
    ),
    Guard(
        "a black picture is given by the driver",
        "tega/unit/test_digit::a_fault_is_counted_silences_and_is_survived[black]",
        "if good and time.monotonic_ns() - opened_ns",
        "if time.monotonic_ns() - opened_ns",
    ),
    Guard(
        "a tracker that jumps away and back keeps its vote",
        "tega/unit/test_arm::a_tracker_that_jumps_away_and_back_has_no_vote_until_it_is_steady",
        "            self._untrusted |= len(self._jumps_ns) == _JUMPS and spread_ms <= _STEADY_MS",
        "            del spread_ms",
    ),
    Guard(
        "the guard of a Bluetooth vest is dismissed whatever the vest took",
        "tega_bench/test_vests::a_vest_that_takes_no_zeros_is_not_left_alone",
        "        if self.silent:\n            guard.dismiss()",
        "        if True:\n            guard.dismiss()",
    ),
    Guard(
        "a run begins with a day of its own",
        "together/test_dose_file::a_second_run_of_the_day_begins_where_the_first_ended",
        "        budget.carry(dose_s=self._carried_s, heat=heat)",
    ),
    Guard(
        "who is not named has a day of their own",
        "together/test_dose_file::who_is_not_named_begins_where_the_one_who_had_most_left_off",
        "        if others:",
    ),
    Guard(
        "a rehearsal passes for a session",
        "tega_study/test_study_lead::a_rehearsal_in_a_plan_of_people_and_people_in_one_of_rehearsals_are_refused",
        '    if where != "lab" and not plan.settings.simulated:',
    ),
    Guard(
        "a stray key ends a trial",
        "tega_study/test_study_lead::the_key_that_begins_a_trial_does_not_end_it_and_its_first_second_is_quiet",
        "QUIET_S = 1.0",
        "QUIET_S = 0.0",
    ),
    Guard(
        "an attempt that was to be repeated counts",
        "tega_study/test_study_lead::a_trial_that_was_to_be_done_again_and_was_not_is_no_data",
        "            if any(event in redone for event in runs[-1]):",
    ),
    Guard(
        "any page may press the buttons",
        "tega_sim/test_view_browser::only_pages_of_this_server_with_its_token_can_connect",
        '            if (why := _refused(request, token, allow_remote=allow_remote)) != "":',
        '            if (why := "") != "":',
    ),
    Guard(
        "one refusal of the transport ends the sending",
        "tega_link/test_net_stations::a_message_that_the_transport_refuses_does_not_end_the_sending",
        "                self._not_sent(_first_line(error))",
        "                return",
    ),
    Guard(
        "a copy of a running recording takes its memory",
        "tools/test_recording_disk::looking_into_a_copy_takes_nothing_from_a_recording_that_goes_on",
        '    if _owner(folder).get("file") != [own.st_dev, own.st_ino] or not _abandoned(folder):',
    ),
    Guard(
        "what a killed recording left in memory stays there",
        "tools/test_recording_disk::"
        "what_a_killed_recording_left_in_memory_goes_to_its_file_when_the_next_one_begins",
        "        rescue_tails()",
    ),
    Guard(
        "withdrawing follows a link",
        "tega_study/test_study_plan::withdrawal_works_through_links_without_following_them",
        "        if path.is_dir() and not path.is_symlink():",
        "        if path.is_dir():",
    ),
    Guard(
        "withdrawing leaves what was made of the person elsewhere unsaid",
        "tega_study/test_study_plan::withdrawal_tells_of_every_trace_that_it_does_not_delete",
        "        if copy not in seen and os.path.lexists(copy):",
    ),
    Guard(
        "a painter that fails is not started again",
        "tega_sim/test_view_browser::a_moment_that_cannot_be_painted_is_told_and_the_next_one_is_painted",
        "            self._fail(error)\n            rest_s = _RETRY_S",
        "            self._fail(error)\n            raise",
    ),
    Guard(
        "the page of a run that stands still looks alive",
        "tega_sim/test_view_browser::a_run_that_stands_still_is_told_to_be_until_it_ends",
        "        if now_s - offered_s < NO_NEWS_S:",
        "        if True:",
    ),
    Guard(
        "torques of the step before stay where a step ends with an error",
        "tega/unit/test_hand::whatever_is_raised_no_torque_is_left_to_be_sent",
        "                out.fill(0.0)",
    ),
    Guard(
        "a pipe is waited for",
        "tega/property/test_foreign_files::a_pipe_a_device_and_a_socket_are_refused_at_once",
        "        if is_kind(there.st_mode):",
    ),
    Guard(
        "a file of any size is read",
        "tega/property/test_foreign_files::a_file_larger_than_any_of_its_kind_is_refused_unread",
        "    if there.st_size > most_mib * MIB:",
    ),
    Guard(
        "the folder of a killed run blocks the next one",
        "together/test_replay::a_run_that_was_killed_leaves_a_folder_that_the_next_one_takes",
        '    begun = {"format": SUMMARY_FORMAT, "version": 1, "ended": NOT_ENDED}',
        "    return",
    ),
    Guard(
        "the hand's torque has the vendor's ceiling",
        "hazards/test_lost::no_torque_is_beyond_the_share_that_is_set",
        " * self.torque_share",
    ),
    Guard(
        "an adapter that was closed is not opened again",
        "tools/test_soak::a_soak_of_one_fault_passes[stop-program]",
        " and not (may_reopen and self._reopened())",
    ),
    Guard(
        "a finger's last picture stays on the vest",
        "tools/test_soak::a_soak_of_one_fault_passes[pause-index]",
        "if t_ns - contact.t_ns <= STALE_NS}",
        "if True}",
    ),
)
