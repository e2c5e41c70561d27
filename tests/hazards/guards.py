"""Lists the guards that can be taken out, or made ten times as slow, with the test that fails then."""

from __future__ import annotations

from typing import Final, NamedTuple

__all__ = ["GUARDS", "LATE", "Guard"]

_LOST: Final = "tests/hazards/test_lost.py::test_"
_STOP: Final = "tests/hazards/test_stop.py::test_"
_LAWS: Final = "tests/tega/property/test_safety.py::test_"
_HAND: Final = "tests/tega/unit/test_hand_guard.py::test_"
_NAMES: Final = "tests/together/test_hostile_names.py::test_"
_TIMES: Final = "tests/hazards/test_times.py::test_"
_DEVICE_TIMES: Final = "tests/hazards/test_device_times.py::test_"
_VOTES: Final = "tests/tega/unit/test_emg_votes.py::test_"
_LEAD: Final = "tests/tega_study/test_study_lead.py::test_"
_DISK: Final = "tests/tools/test_recording_disk.py::test_"
_PLAN: Final = "tests/tega_study/test_study_plan.py::test_"
_PAGE: Final = "tests/tega_sim/test_view_browser.py::test_"
_FOREIGN: Final = "tests/tega/property/test_foreign_files.py::test_"
_PICTURES: Final = "tests/tega/unit/test_picture_votes.py::test_"
_VESTS: Final = "tests/tega_bench/test_vests.py::test_"
_START: Final = "tests/tega_study/test_arm_to_start.py::test_"
_REFLEX: Final = "tests/tega/property/test_reflex.py::test_"
_STAND: Final = "tests/tega/unit/test_hand_standstill.py::test_"
_LIMB: Final = "tests/tega/unit/test_limb_loss.py::test_"


class Guard(NamedTuple):
    """A guard that can be taken out.

    Attributes:
        what: What is then so.
        old: The text that does it; stands once in ``python/tega``.
        new: What stands there without it.
        shown_by: The test that fails then; or ``soak HOW DEVICE``, a soak of that fault alone.
    """

    what: str
    old: str
    new: str
    shown_by: str


GUARDS: Final = (
    Guard(
        "the reflex's sum has no bound",
        "self.added = min(max(added, 0.0), self._s.most_levels, _CLOSED - own)",
        "self.added = added",
        f"{_REFLEX}a_closed_hand_is_told_no_more_than_closed",
    ),
    Guard(
        "the reflex firms the grip at once",
        "self.added + self._s.rise_levels_per_s * dt_s)",
        "9.0)",
        f"{_REFLEX}the_addition_is_bounded_slow_and_never_below_the_person_s_own_closure",
    ),
    Guard(
        "the reflex needs no authority",
        "target = authority * self._s.most_levels * max(wish, 0.0)",
        "target = self._s.most_levels * max(wish, 0.0)",
        f"{_REFLEX}a_slip_firms_the_grip_by_its_share_and_the_addition_decays_when_it_ends",
    ),
    Guard(
        "the reflex holds what somebody opens the hand for",
        "        if own <= _OPEN:\n            added = 0.0",
        "        if False:\n            added = 0.0",
        f"{_REFLEX}who_opens_the_hand_lets_go_at_once",
    ),
    Guard(
        "the reflex answers the slip of what is let go",
        "held_back = not now.allowed or self._firmest - own >= _LOOSENED",
        "held_back = not now.allowed",
        f"{_REFLEX}who_loosens_the_grip_is_not_held_against_it_by_the_slip_that_follows",
    ),
    Guard(
        "the reflex goes on in a hold",
        "held_back = not now.allowed or self._firmest - own >= _LOOSENED",
        "held_back = self._firmest - own >= _LOOSENED",
        f"{_TIMES}what_a_reflex_added_is_taken_back_within_200_ms_of_a_hold",
    ),
    Guard(
        "the reflex firms a grip that no finger feels",
        "holding = own > _OPEN and any(contact.in_contact for contact in fresh.values())",
        "holding = own > _OPEN",
        f"{_REFLEX}a_wish_counts_for_nothing_while_no_finger_touches",
    ),
    Guard(
        "EMG that is lost is not seen",
        "        if age_ns > stale_ns:",
        '        if age_ns > stale_ns and stream.kind != "emg":',
        f"{_LOST}emg_unplugged_holds_the_level_then_opens_the_hand",
    ),
    Guard(
        "a hold lasts for ever",
        'give_up_ns=round(s.hold_ms * 1e6) if s.then == "open" else None',
        "give_up_ns=None",
        f"{_LOST}emg_unplugged_holds_the_level_then_opens_the_hand",
    ),
    Guard(
        '`then = "keep"` is not heeded',
        'round(s.hold_ms * 1e6) if s.then == "open" else None',
        "round(s.hold_ms * 1e6)",
        f"{_LOST}emg_lost_keeps_the_level_where_the_settings_say_so",
    ),
    Guard(
        "a board that went away is not looked for",
        "            if not opened_again(source, stopped):",
        "            if True:",
        f"{_LOST}emg_that_comes_back_steers_again",
    ),
    Guard(
        "a board's rate is taken on trust",
        "if abs(measured_hz / rate_hz - 1) <= RATE_TOLERANCE:",
        "if True:",
        f"{_LOST}a_slow_board_is_refused",
    ),
    Guard(
        "a finger's last picture stays on the vest",
        "if t_ns - contact.t_ns <= STALE_NS}",
        "if True}",
        f"{_LOST}a_lost_camera_silences_its_column_and_no_other[pause-]",
    ),
    Guard(
        "a lost camera never holds",
        'if stream.kind == "emg" or s.tactile_lost == "hold":',
        'if stream.kind == "emg":',
        f"{_LOST}a_lost_camera_holds_the_hand_where_the_settings_say_so[pause-]",
    ),
    Guard(
        "nobody asks for a stream's rate",
        "            elif text := self._slow(stream):",
        '            elif text := "":',
        f"{_LOST}a_slow_camera_does_not_arm",
    ),
    Guard(
        "a live run needs no calibration",
        "            if source is not None and source.info.live:",
        "            if False:",
        f"{_LOST}without_calibration_nothing_starts",
    ),
    Guard(
        "the loop does not ask how the hand is",
        "        self._check().say(level, added)",
        "        (self._end or self._check()).say(level, added)",
        f"{_LOST}a_silent_hand_ends_the_run",
    ),
    Guard(
        "the loop does not ask how the hand is",
        "        self._check().say(level, added)",
        "        (self._end or self._check()).say(level, added)",
        f"{_LOST}a_hand_in_trouble_is_let_go_and_the_vest_rests",
    ),
    Guard(
        "the dead-man is not asked",
        "is not None and not dead_man.held:",
        "is not None and False:",
        f"{_LOST}a_released_dead_man_holds",
    ),
    Guard(
        "a dead-man that says nothing counts as held",
        "if t_ns - self._received_ns > limit_ms * 1e6:",
        "if False:",
        f"{_LOST}a_dead_man_that_freezes_while_it_is_held_holds",
    ),
    Guard(
        "nobody looks whether the vest is there",
        "if worn else {}",
        "if False else {}",
        f"{_LOST}a_lost_vest_is_told_and_the_run_goes_on",
    ),
    Guard(
        "a lost vest never holds",
        'if s.vest_lost == "hold":',
        "if False:",
        f"{_LOST}a_lost_vest_holds_the_hand_where_the_settings_say_so",
    ),
    Guard(
        "a late loop goes on as if nothing were",
        "        return late_ns > self._late_ns and bool(self._streams or self._vests)",
        "        return False",
        f"{_LOST}a_late_loop_holds_and_the_vest_rests_meanwhile",
    ),
    Guard(
        "the vest has no watchdog",
        "WATCHDOG_S: Final = 0.2",
        "WATCHDOG_S: Final = 1e6",
        f"{_LOST}a_late_loop_holds_and_the_vest_rests_meanwhile",
    ),
    Guard(
        "a table that cannot be written is not told of",
        "        except Exception as error:  # whoever looks on must not end what it looks at",
        "        except ZeroDivisionError as error:",
        f"{_STOP}a_full_disk_ends_the_tables_and_not_the_run",
    ),
    Guard(
        "no process guards the hand",
        "if o.guard and o.torque",
        "if False and o.torque",
        f"{_HAND}a_killed_or_frozen_process_of_the_hand_does_not_leave_it_pushing",
    ),
    Guard(
        "the hand's process does not let go while the run stands still",
        "            if self._bus.switch_off(self._off, device_id=device_id, patience_s=_STILL_OFF_S):",
        "            if True:",
        f"{_HAND}a_killed_or_frozen_program_without_a_guard_lets_go_of_the_hand",
    ),
    Guard(
        "the hand's process goes on while the run stands still",
        "return self._n_words, time.monotonic() - self._last_s if self._received else 0.0",
        "return time.monotonic_ns(), 0.0",
        f"{_STOP}a_killed_or_frozen_run_leaves_all_safe",
    ),
    Guard(
        "it does not see a standstill",
        "STUCK_S: Final = 1.0",
        "STUCK_S: Final = 1e6",
        f"{_HAND}a_frozen_program_and_hand_process_do_not_leave_the_hand_pushing",
    ),
    Guard(
        "programs beside a run die of the signals of a log-out",
        "    words[words.index(_BEGIN)] = _IGNORE + _BEGIN",
        "    pass",
        "tests/tega_scene/test_child_process.py::"
        "test_a_program_ignores_the_signals_of_a_log_out_and_ends_with_its_input[hand's guard]",
    ),
    Guard(
        "a run that has lost hand process and guard does nothing",
        "            self._let_go_instead()",
        "            pass",
        f"{_HAND}a_run_that_has_lost_hand_process_and_guard_lets_go_of_the_hand",
    ),
    Guard(
        "a silent process of the hand may go on later",
        "                self._process.kill()  # it must not go on later",
        "                pass  #",
        f"{_HAND}a_run_that_has_lost_hand_process_and_guard_lets_go_of_the_hand",
    ),
    Guard(
        "a hand is steered on after the computer slept",
        "                if standstill.pulse():",
        "                if False:",
        f"{_STAND}a_computer_that_slept_ends_the_hand",
    ),
    Guard(
        "a torque that was computed before a standstill is sent after it",
        "outdated=standstill.is_over if pushes else _never",
        "outdated=_never",
        f"{_STAND}a_torque_that_was_computed_before_a_standstill_is_not_sent",
    ),
    Guard(
        "the computer goes to sleep with the motors on",
        "            self._on_sleep()",
        "            pass",
        "tests/tega/unit/test_sleep_lock.py::test_a_hand_is_let_go_before_the_computer_sleeps",
    ),
    Guard(
        "a guard that gives up says nothing",
        '            alarm.end(why if gone else "")',
        "            pass",
        f"{_HAND}a_guard_that_gives_up_writes_to_the_system_s_log",
    ),
    Guard(
        "last words name a process without a look at it",
        "        if guard_runs(seen.guard_pid):",
        "        if seen.guard_pid or True:",
        f"{_HAND}last_words_name_no_process_that_does_not_run",
    ),
    Guard(
        "a Bluetooth vest's guard does not see a standstill",
        "STUCK_S: Final = 1.0",
        "STUCK_S: Final = 1e6",
        f"{_VESTS}a_bluetooth_vest_that_was_silenced_in_a_standstill_is_felt_again",
    ),
    Guard(
        "a Bluetooth vest's driver does not tell its guard that it lives",
        "        if self.guard is not None:\n            self.guard.beat()",
        "        pass",
        "soak stop program",
    ),
    Guard(
        "the dead-man is not asked on the way to the start",
        "        dead_man=turn.dead_man and turn.may_move,",
        "        dead_man=turn.may_move,",
        f"{_START}the_emulated_arm_and_hand_go_to_their_start_while_the_switch_is_held",
    ),
    Guard(
        "the way to the start goes on without a guard of the hand",
        "may_move=lambda: time.monotonic() >= warned_until_s and not hand.unguarded,",
        "may_move=lambda: time.monotonic() >= warned_until_s,",
        f"{_START}the_way_to_the_start_holds_while_the_hand_s_guard_is_lost",
    ),
    Guard(
        "the loss of the arm's process is not seen",
        '        if arm.phase in {"faulted", "gone"} and (text := arm.problem):',
        '        if arm.phase == "faulted" and (text := arm.problem):',
        "tests/tega/unit/test_arm_run.py::test_an_arm_whose_process_is_killed_stops_and_the_run_goes_on",
    ),
    Guard(
        "the loss of the recorder's process is not told",
        "                self._stop(self._gone())\n            self._queue.close()",
        "                pass\n            self._queue.close()",
        "tests/tega/unit/test_recorder_process.py::"
        "test_a_killed_process_stops_the_recording_with_a_word_and_the_file_is_recovered",
    ),
    Guard(
        "a negative dose lengthens the day",
        "_AtLeast0 = Annotated[float, msgspec.Meta(ge=0)]",
        "_AtLeast0 = float",
        "tests/together/test_dose_file.py::test_a_number_that_would_lengthen_the_day_is_refused",
    ),
    Guard(
        "any machine may be the Player's",
        "    if not (o.allow_remote or _is_here(o.host)):",
        "    if False:",
        "tests/tega_bench/test_vest_player.py::test_another_machine_is_asked_only_where_the_settings_say_so",
    ),
    Guard(
        "the working folder comes first for programs that are started",
        'sys.executable, "-P", "-c", _BEGIN',
        'sys.executable, "-c", _BEGIN',
        f"{_HAND}files_in_the_working_folder_do_not_take_the_guard_s_place",
    ),
    Guard(
        "the guard of the hand is dismissed whatever the hand says",
        "        if self._let_go:\n            if guard is not None:",
        "        if True:\n            if guard is not None:",
        f"{_HAND}a_deaf_hand_is_not_left_alone",
    ),
    Guard(
        "nobody sees that the guard of the hand is gone",
        '            self.problem = f"the process that {self._subject} was lost; another is being started"',
        "            return",
        f"{_LOST}the_loss_of_the_hand_s_guard_holds_until_there_is_another",
    ),
    Guard(
        "a guard that takes a lost one's place at the end is dismissed whatever the device says",
        """                if closing:
                    self._part_from(process)""",
        """                if closing:
                    self._write(b"done\\n", process)""",
        "tests/tega/unit/test_guard_process.py::test_a_device_that_is_left_while_its_guard_is_replaced_is_let_go_of",
    ),
    Guard(
        "a guard that dies as the device is left to it is taken for one that has it",
        "if self._closing.is_set() and (self._safe or self._has_it.is_set()):",
        "if self._closing.is_set():",
        "tests/tega/unit/test_guard_process.py::"
        "test_a_device_that_is_left_before_its_guard_s_loss_is_seen_is_let_go_of[killed]",
    ),
    Guard(
        "a device is left to a guard that stands still",
        "            self._process.kill()  # it stands still: the thread that watches it starts another",
        "            pass",
        "tests/tega/unit/test_guard_process.py::"
        "test_a_device_that_is_left_before_its_guard_s_loss_is_seen_is_let_go_of[stopped]",
    ),
    Guard(
        "a run removes the results of an earlier one",
        "        path.rename(kept / path.name)  # a link is moved, not what it leads to",
        "        path.unlink()",
        "tests/together/test_replay.py::test_the_results_of_an_earlier_run_are_kept_and_told",
    ),
    Guard(
        "a closed terminal ends the program at once",
        '("SIGTERM", "SIGHUP")',
        '("SIGTERM",)',
        f"{_HAND}a_closed_terminal_lets_go_of_the_hand",
    ),
    Guard(
        "signals are not taken",
        "            self._old[number] = signal.signal(number, self._on_signal)",
        "            pass",
        f"{_STOP}a_signal_stops_and_leaves_all_safe",
    ),
    Guard(
        "every Ctrl-C cuts in",
        "        elif not self._interrupted and time.monotonic() - self._requested_s > _PATIENCE_S:",
        "        else:",
        f"{_STOP}impatience_stops_as_well",
    ),
    Guard("keys are not read", "        stop.also(pressed)\n", "", f"{_STOP}a_key_stops"),
    Guard(
        "the set time is not kept",
        "                if duration_ns is not None and t_ns >= duration_ns:",
        "                if False:",
        f"{_STOP}the_set_time_stops",
    ),
    Guard(
        "a mistake in the program leaves everything as it is",
        "            for problem in self._leave(last_ns, _failure(error)):\n",
        "            for problem in []:\n",
        f"{_STOP}an_error_in_the_program_stops",
    ),
    Guard(
        "no limit before the vest",
        "allowed = self.budget.allow(time.monotonic_ns(), frame.x40())",
        "allowed = frame.x40()",
        f"{_LAWS}a_driver_s_link_is_never_told_more_than_the_limit",
    ),
    Guard(
        "no heat of motors",
        "np.sqrt(np.minimum(np.maximum(squared, 0.0), 1.0))",
        "np.ones(40)",
        f"{_LAWS}no_input_drives_a_motor_beyond_ceiling_heat_or_dose",
    ),
    Guard(
        "the hand's own share of torque is not passed on",
        "            controller._native,",
        "            type(controller)()._native,",
        f"{_LAWS}no_frames_of_a_hand_lead_to_a_torque_beyond_its_limits",
    ),
    Guard(
        "arming waits for nothing",
        '        if self.state == "idle" and clear:',
        '        if self.state == "idle":',
        f"{_LAWS}no_sequence_of_events_leads_to_active_without_every_condition",
    ),
    Guard(
        "a level passes in every state",
        '        elif state != "hold":\n            self._level = _OPEN',
        "        else:\n            self._level = wanted",
        f"{_LAWS}only_an_active_run_passes_a_level_on",
    ),
    Guard(
        "a finger's joint is taken for the wrist",
        "_WRIST_NUMBER: Final = 1\n",
        "_WRIST_NUMBER: Final = 10\n",
        f"{_LIMB}no_byte_of_a_packet_but_the_wrist_s_changes_a_pose",
    ),
    Guard(
        "names in a file become paths as they are",
        "    if not _PLAIN.fullmatch(name) or",
        "    if False and",
        f"{_NAMES}an_attachment_s_name_never_leaves_the_folder",
    ),
    Guard(
        "electrodes that are off keep their vote",
        "        changed, passed = self._core.take(np.ascontiguousarray(samples, np.float64))",
        "        changed, passed = False, None",
        f"{_LOST}electrodes_that_are_off_hold_the_level_then_open_the_hand[rail-stays at]",
    ),
    Guard(
        "one electrode that is off keeps its vote",
        "        changed, passed = self._core.take(np.ascontiguousarray(samples, np.float64))",
        "        changed, passed = False, None",
        f"{_LOST}one_electrode_that_is_off_has_no_vote_and_the_others_go_on",
    ),
    Guard(
        "the level that a fault has made is what the run holds",
        "            intent = replace(intent, level=before.level, closure=before.closure)",
        "            pass",
        f"{_VOTES}a_fault_of_every_channel_keeps_the_level_before_it",
    ),
    Guard(
        "a tracker's jump is believed",
        '            return f"{JUMPED} {1e3 * step_m:.0f} mm"',
        '            return ""',
        "tests/tega/unit/test_arm.py::test_a_jump_is_believed_once_the_hand_was_lost",
    ),
    Guard(
        "a dim picture keeps its vote",
        "    if share < _DARK_SHARE:",
        "    if False:",
        f"{_PICTURES}a_dark_camera_has_no_vote_until_half_a_second_after_the_last_dark_picture",
    ),
    Guard(
        "a torn picture keeps its vote",
        "    if of_one_colour or any(map(operator.eq, now, before)):",
        "    if False:",
        f"{_PICTURES}a_torn_picture_is_left_out_and_a_camera_that_tears_them_has_no_vote",
    ),
    Guard(
        "the same picture again counts as a new one",
        "if self._live and self._n_equal >= STUCK_FRAMES:",
        "if False:",
        f"{_PICTURES}a_frozen_camera_has_no_vote_until_a_picture_differs",
    ),
    Guard(
        "a black picture is given by the driver",
        "if good and time.monotonic_ns() - opened_ns",
        "if time.monotonic_ns() - opened_ns",
        "tests/tega/unit/test_digit.py::test_a_fault_is_counted_silences_and_is_survived[black]",
    ),
    Guard(
        "a tracker that jumps away and back keeps its vote",
        "            self._untrusted |= len(self._jumps_ns) == _JUMPS and spread_ms <= _STEADY_MS",
        "            del spread_ms",
        "tests/tega/unit/test_arm.py::test_a_tracker_that_jumps_away_and_back_has_no_vote_until_it_is_steady",
    ),
    Guard(
        "the guard of a Bluetooth vest is dismissed whatever the vest took",
        "        if self.silent:\n            guard.dismiss()",
        "        if True:\n            guard.dismiss()",
        "tests/tega_bench/test_vests.py::test_a_vest_that_takes_no_zeros_is_not_left_alone",
    ),
    Guard(
        "a run begins with a day of its own",
        "        budget.carry(dose_s=self._carried_s, heat=heat)",
        "        pass",
        "tests/together/test_dose_file.py::test_a_second_run_of_the_day_begins_where_the_first_ended",
    ),
    Guard(
        "who is not named has a day of their own",
        "        if others:",
        "        if False:",
        "tests/together/test_dose_file.py::test_who_is_not_named_begins_where_the_one_who_had_most_left_off",
    ),
    Guard(
        "a rehearsal passes for a session",
        '    if where != "lab" and not plan.settings.simulated:',
        "    if False:",
        f"{_LEAD}a_rehearsal_in_a_plan_of_people_and_people_in_one_of_rehearsals_are_refused",
    ),
    Guard(
        "a stray key ends a trial",
        "QUIET_S = 1.0",
        "QUIET_S = 0.0",
        f"{_LEAD}the_key_that_begins_a_trial_does_not_end_it_and_its_first_second_is_quiet",
    ),
    Guard(
        "an attempt that was to be repeated counts",
        "            if any(event in redone for event in runs[-1]):",
        "            if False:",
        f"{_LEAD}a_trial_that_was_to_be_done_again_and_was_not_is_no_data",
    ),
    Guard(
        "any page may press the buttons",
        '            if (why := _refused(request, token, allow_remote=allow_remote)) != "":',
        '            if (why := "") != "":',
        "tests/tega_sim/test_view_browser.py::test_only_pages_of_this_server_with_its_token_can_connect",
    ),
    Guard(
        "one refusal of the transport ends the sending",
        "                self._not_sent(_first_line(error))",
        "                return",
        "tests/tega_link/test_net_stations.py::test_a_message_that_the_transport_refuses_does_not_end_the_sending",
    ),
    Guard(
        "a copy of a running recording takes its memory",
        '    if _owner(folder).get("file") != [own.st_dev, own.st_ino] or not _abandoned(folder):',
        "    if False:",
        f"{_DISK}looking_into_a_copy_takes_nothing_from_a_recording_that_goes_on",
    ),
    Guard(
        "what a killed recording left in memory stays there",
        "        rescue_tails()",
        "        pass",
        f"{_DISK}what_a_killed_recording_left_in_memory_goes_to_its_file_when_the_next_one_begins",
    ),
    Guard(
        "withdrawing follows a link",
        "        if path.is_dir() and not path.is_symlink():",
        "        if path.is_dir():",
        f"{_PLAN}withdrawal_works_through_links_without_following_them",
    ),
    Guard(
        "withdrawing leaves what was made of the person elsewhere unsaid",
        "        if copy not in seen and os.path.lexists(copy):",
        "        if False:",
        f"{_PLAN}withdrawal_tells_of_every_trace_that_it_does_not_delete",
    ),
    Guard(
        "a painter that fails is not started again",
        "            self._fail(error)\n            rest_s = _RETRY_S",
        "            self._fail(error)\n            raise",
        f"{_PAGE}a_moment_that_cannot_be_painted_is_told_and_the_next_one_is_painted",
    ),
    Guard(
        "the page of a run that stands still looks alive",
        "        if now_s - offered_s < NO_NEWS_S:",
        "        if True:",
        f"{_PAGE}a_run_that_stands_still_is_told_to_be_until_it_ends",
    ),
    Guard(
        "torques of the step before stay where a step ends with an error",
        "                out.fill(0.0)",
        "                pass",
        "tests/tega/unit/test_hand.py::test_whatever_is_raised_no_torque_is_left_to_be_sent",
    ),
    Guard(
        "a pipe is waited for",
        "        if is_kind(there.st_mode):",
        "        if False:",
        f"{_FOREIGN}a_pipe_a_device_and_a_socket_are_refused_at_once",
    ),
    Guard(
        "a file of any size is read",
        "    if there.st_size > most_mib * MIB:",
        "    if False:",
        f"{_FOREIGN}settings_are_refused_by_their_own_error",
    ),
    Guard(
        "the folder of a killed run blocks the next one",
        '    begun = {"format": SUMMARY_FORMAT, "version": 1, "ended": NOT_ENDED}',
        "    return",
        "tests/together/test_replay.py::test_a_run_that_was_killed_leaves_a_folder_that_the_next_one_takes",
    ),
    Guard(
        "the hand's torque has the vendor's ceiling",
        "torque_limits=TORQUE_LIMITS * self.torque_share",
        "torque_limits=TORQUE_LIMITS",
        f"{_LOST}no_torque_is_beyond_the_share_that_is_set",
    ),
    Guard(
        "an adapter that was closed is not opened again",
        "if self._bus is None and not (may_reopen and self._reopened()):",
        "if self._bus is None:",
        "soak stop program",
    ),
    Guard(
        "a finger's last picture stays on the vest",
        "if t_ns - contact.t_ns <= STALE_NS}",
        "if True}",
        "soak pause index",
    ),
)
"""Every guard, with what shows that it is needed."""


def _late(subject: str, old: str, new: str, shown_by: str) -> Guard:
    return Guard(f"{subject} takes ten times as long", old, new, shown_by)


LATE: Final = (
    _late(
        "the way back of what a reflex added",
        "_BACK_LEVELS_PER_S: Final = 5.0",
        "_BACK_LEVELS_PER_S: Final = 0.5",
        f"{_TIMES}what_a_reflex_added_is_taken_back_within_200_ms_of_a_hold",
    ),
    _late(
        "the vest's watchdog",
        "WATCHDOG_S: Final = 0.2",
        "WATCHDOG_S: Final = 2.0",
        f"{_DEVICE_TIMES}a_vest_that_is_told_nothing_rests_within_200_ms",
    ),
    _late(
        "a vest that takes no frame",
        "_STALLED_S = 1.0  #",
        "_STALLED_S = 10.0  #",
        f"{_DEVICE_TIMES}a_vest_that_takes_no_frame_counts_as_lost_after_a_second",
    ),
    _late(
        "a stale finger",
        "\nSTALE_NS = 100_000_000",
        "\nSTALE_NS = 1_000_000_000",
        f"{_TIMES}a_stale_finger_is_silent_after_100_ms_and_a_refresh",
    ),
    _late(
        "a lost picture",
        "_STALE_PICTURE_NS = 100_000_000",
        "_STALE_PICTURE_NS = 1_000_000_000",
        f"{_TIMES}a_lost_picture_holds_within_120_ms_where_the_settings_say_so",
    ),
    _late(
        "a look at everything",
        "_POLL_NS = 10_000_000",
        "_POLL_NS = 100_000_000",
        f"{_TIMES}a_dead_man_a_late_loop_and_a_lost_link_hold_at_the_next_look",
    ),
    _late(
        "a late loop",
        "msgspec.Meta(ge=5, le=5000)] = 100.0",
        "msgspec.Meta(ge=5, le=5000)] = 1000.0",
        f"{_TIMES}a_dead_man_a_late_loop_and_a_lost_link_hold_at_the_next_look",
    ),
    _late(
        "lost EMG",
        "msgspec.Meta(ge=20, le=5000)] = 150.0",
        "msgspec.Meta(ge=20, le=5000)] = 1500.0",
        f"{_TIMES}emg_lost_holds_within_260_ms_of_its_last_block_and_opens_2_s_later",
    ),
    _late(
        "a hold",
        "hold_ms: _Ms = 2000.0",
        "hold_ms: _Ms = 20_000.0",
        f"{_TIMES}emg_lost_holds_within_260_ms_of_its_last_block_and_opens_2_s_later",
    ),
    _late(
        "a stuck electrode",
        "\n_STUCK_S = 0.1",
        "\n_STUCK_S = 1.0",
        f"{_VOTES}a_fault_of_every_channel_keeps_the_level_before_it",
    ),
    _late(
        "mains",
        "_MAINS_S = 0.2",
        "_MAINS_S = 2.0",
        f"{_VOTES}a_fault_of_every_channel_keeps_the_level_before_it",
    ),
    _late(
        "a camera's way back",
        "_BACK_NS = 500_000_000",
        "_BACK_NS = 5_000_000_000",
        f"{_PICTURES}a_dark_camera_has_no_vote_until_half_a_second_after_the_last_dark_picture",
    ),
    _late(
        "a tracker's way back",
        "_STEADY_MS = 500.0",
        "_STEADY_MS = 5000.0",
        "tests/tega/unit/test_arm.py::test_a_tracker_that_jumps_away_and_back_has_no_vote_until_it_is_steady",
    ),
    _late(
        "a tracker that does not come back",
        "    lost_ms: _Ms = 250.0",
        "    lost_ms: _Ms = 2500.0",
        "tests/tega/unit/test_arm.py::test_a_jump_is_believed_once_the_hand_was_lost",
    ),
    _late(
        "no news on the page",
        "NO_NEWS_S: Final = 1.5",
        "NO_NEWS_S: Final = 15.0",
        f"{_TIMES}a_page_without_news_says_so_after_a_second_and_a_half",
    ),
    _late(
        "a silent hand",
        "msgspec.Meta(ge=10, le=10_000)] = 30.0",
        "msgspec.Meta(ge=10, le=10_000)] = 300.0",
        f"{_DEVICE_TIMES}a_silent_hand_is_let_go_within_30_ms",
    ),
    _late(
        "a slow hand",
        "msgspec.Meta(ge=0, le=1000)] = 250.0",
        "msgspec.Meta(ge=0, le=1000)] = 25.0",
        f"{_DEVICE_TIMES}a_slow_hand_is_let_go_within_a_second",
    ),
    _late(
        "a program that stands still",
        "STUCK_S: Final = 1.0",
        "STUCK_S: Final = 10.0",
        f"{_DEVICE_TIMES}a_program_that_stands_still_is_taken_over_from_within_a_second",
    ),
    _late(
        "a Bluetooth vest's program that stands still",
        "STUCK_S: Final = 1.0",
        "STUCK_S: Final = 10.0",
        f"{_DEVICE_TIMES}a_bluetooth_vest_is_silenced_within_a_second_of_a_standstill",
    ),
    _late(
        "a Bluetooth vest that takes no zeros",
        "_CALL_S = 1.5",
        "_CALL_S = 15.0",
        f"{_DEVICE_TIMES}a_bluetooth_vest_that_takes_no_zeros_is_left_to_its_guard_after_a_second_and_a_half",
    ),
    _late(
        "a hand that does not hear its end",
        "CONFIRM_S = 3.0",
        "CONFIRM_S = 30.0",
        f"{_DEVICE_TIMES}a_hand_that_does_not_hear_its_end_is_left_to_its_guard_after_three_seconds",
    ),
    _late(
        "a guard that stands still",
        "DEAF_S: Final = 2.0",
        "DEAF_S: Final = 20.0",
        f"{_DEVICE_TIMES}a_guard_that_stands_still_is_replaced_within_two_seconds",
    ),
    _late(
        "a dead-man that says nothing",
        "if t_ns - self._received_ns > limit_ms * 1e6:",
        "if t_ns - self._heard_ns > limit_ms * 1e7:",
        f"{_TIMES}a_dead_man_that_says_nothing_is_let_go_after_its_time",
    ),
    _late(
        "an old message",
        "ttl_ms: _Ms = 100.0",
        "ttl_ms: _Ms = 1000.0",
        f"{_TIMES}a_message_older_than_100_ms_is_not_used",
    ),
)
"""The times of the hazard table, each ten times as long, with the test on a clock of its own that fails then."""
