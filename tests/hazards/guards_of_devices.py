"""The guards of reflex, muscles, cameras, vest, hand and arm, and of the processes that watch them."""

from __future__ import annotations

from typing import Final

from hazards.guards import Guard

OF_DEVICES: Final = (
    Guard(
        "the reflex's sum has no bound",
        "tega/property/test_reflex::the_addition_is_bounded_slow_and_never_below_the_person_s_own_closure",
        "self.added = min(max(added, 0.0), self._s.most_levels, _CLOSED - own)",
        "self.added = added",
    ),
    Guard(
        "the reflex firms the grip at once",
        "tega/property/test_reflex::the_addition_is_bounded_slow_and_never_below_the_person_s_own_closure",
        "self.added + self._s.rise_levels_per_s * dt_s)",
        "9.0)",
    ),
    Guard(
        "the reflex needs no authority",
        "tega/property/test_reflex::a_slip_firms_the_grip_by_its_share_and_the_addition_decays_when_it_ends",
        "authority * ",
    ),
    Guard(
        "the reflex holds what somebody opens the hand for",
        "tega/property/test_reflex::who_opens_the_hand_lets_go_at_once",
        "        if own <= _OPEN:\n            added = 0.0",
        "        if False:\n            added = 0.0",
    ),
    Guard(
        "the reflex answers the slip of what is let go",
        "tega/property/test_reflex::who_loosens_the_grip_is_not_held_against_it_by_the_slip_that_follows",
        " or self._firmest - own >= _LOOSENED",
    ),
    Guard(
        "the reflex goes on in a hold",
        "hazards/test_times::what_a_reflex_added_is_taken_back_within_200_ms_of_a_hold",
        "not now.allowed or ",
    ),
    Guard(
        "the reflex firms a grip that no finger feels",
        "tega/property/test_reflex::the_addition_is_bounded_slow_and_never_below_the_person_s_own_closure",
        " and any(contact.in_contact for contact in fresh.values())",
    ),
    Guard(
        "EMG that is lost is not seen",
        "hazards/test_lost_muscles::lost_muscles_hold_the_level_then_open_the_hand_and_steer_again[unplugged]",
        "        if age_ns > stale_ns:",
        '        if age_ns > stale_ns and stream.kind != "emg":',
    ),
    Guard(
        "a hold lasts for ever",
        "hazards/test_lost_muscles::lost_muscles_hold_the_level_then_open_the_hand_and_steer_again[unplugged]",
        'round(s.hold_ms * 1e6) if s.then == "open" else ',
    ),
    Guard(
        '`then = "keep"` is not heeded',
        "hazards/test_lost_muscles::emg_lost_keeps_the_level_where_the_settings_say_so",
        ' if s.then == "open" else None',
    ),
    Guard(
        "a board that went away is not looked for",
        "hazards/test_lost_muscles::lost_muscles_hold_the_level_then_open_the_hand_and_steer_again[silent]",
        "            if not opened_again(source, stopped):",
        "            if True:",
    ),
    Guard(
        "a board's rate is taken on trust",
        "hazards/test_lost_muscles::a_slow_board_is_refused",
        "if abs(measured_hz / rate_hz - 1) <= RATE_TOLERANCE:",
        "if True:",
    ),
    Guard(
        "a finger's last picture stays on the vest",
        "hazards/test_lost::a_lost_camera_silences_its_column_and_no_other[pause-]",
        "if t_ns - contact.t_ns <= STALE_NS}",
        "if True}",
    ),
    Guard(
        "a lost camera never holds",
        "hazards/test_lost::a_lost_camera_holds_the_hand_where_the_settings_say_so[pause-]",
        ' or s.tactile_lost == "hold"',
    ),
    Guard(
        "nobody asks for a stream's rate",
        "hazards/test_lost::a_slow_camera_does_not_arm",
        "            elif text := self._slow(stream):",
        '            elif text := "":',
    ),
    Guard(
        "a live run needs no calibration",
        "hazards/test_lost::without_calibration_nothing_starts",
        "            if source is not None and source.info.live:",
    ),
    Guard(
        "the loop does not ask how the hand is",
        "hazards/test_lost::a_hand_in_trouble_is_let_go_and_the_vest_rests[silence-silent]",
        "        self._check().say(level, added, alone=self.watched)",
        "        (self._end or self._check()).say(level, added, alone=self.watched)",
    ),
    Guard(
        "the dead-man is not asked",
        "hazards/test_lost::a_dead_man_that_is_released_unplugged_or_frozen_holds[lifted]",
        "is not None and not dead_man.held:",
        "is not None and False:",
    ),
    Guard(
        "a dead-man that says nothing counts as held",
        "hazards/test_lost::a_dead_man_that_is_released_unplugged_or_frozen_holds[frozen]",
        "if t_ns - self._received_ns > limit_ms * 1e6:",
    ),
    Guard(
        "nobody looks whether the vest is there",
        "hazards/test_lost::a_lost_vest_is_told_and_the_run_goes_on_or_holds",
        "if worn else {}",
        "if False else {}",
    ),
    Guard(
        "a lost vest never holds",
        "hazards/test_lost::a_lost_vest_is_told_and_the_run_goes_on_or_holds",
        'if s.vest_lost == "hold":',
    ),
    Guard(
        "a late loop goes on as if nothing were",
        "hazards/test_lost::a_late_loop_holds_and_vest_and_hand_rest_meanwhile",
        "        return late_ns > self._late_ns and bool(self._streams or self._vests)",
        "        return False",
    ),
    Guard(
        "the vest has no watchdog",
        "hazards/test_lost::a_late_loop_holds_and_vest_and_hand_rest_meanwhile",
        "WATCHDOG_S: Final = 0.2",
        "WATCHDOG_S: Final = 1e6",
    ),
    Guard(
        "a table that cannot be written is not told of",
        "hazards/test_stop::a_full_disk_ends_the_tables_and_not_the_run",
        "        except Exception as error:  # an observer must not end what it observes",
        "        except ZeroDivisionError as error:",
    ),
    Guard(
        "no process guards the hand",
        "tega/unit/test_hand_guard::a_killed_or_frozen_process_of_the_hand_does_not_leave_it_pushing",
        "if o.guard and o.torque",
        "if False and o.torque",
    ),
    Guard(
        "the hand's process does not let go while the run stands still",
        "tega/unit/test_hand_guard::a_killed_or_frozen_program_without_a_guard_lets_go_of_the_hand",
        "            if self._bus.switch_off(self._off, device_id=device_id, patience_s=_STILL_OFF_S):",
        "            if True:",
    ),
    Guard(
        "the hand's process goes on while the run stands still",
        "hazards/test_stamps::a_killed_or_stuck_run_or_process_of_the_hand_is_let_go_of[run-stuck]",
        "return self._n_words, time.monotonic() - self._last_s",
        "return time.monotonic_ns(), 0.0",
    ),
    Guard(
        "a loop that hangs leaves the hand pushing",
        "hazards/test_lost::a_late_loop_holds_and_vest_and_hand_rest_meanwhile",
        "            model.watched = True  # a loop that hangs must not leave it pushing",
    ),
    Guard(
        "it does not see a standstill",
        "tega/unit/test_hand_guard::a_frozen_program_that_goes_on_steers_again_and_one_frozen_with_its_hand_process_lets_go",
        "STUCK_S: Final = 1.0",
        "STUCK_S: Final = 1e6",
    ),
    Guard(
        "programs beside a run die of the signals of a log-out",
        "tega_scene/test_child_process::"
        "a_program_ignores_the_signals_of_a_log_out_and_ends_with_its_input[hand's guard]",
        "    words[words.index(_BEGIN)] = _IGNORE + _BEGIN",
    ),
    Guard(
        "a run that has lost hand process and guard does nothing",
        "tega/unit/test_hand_guard::a_run_that_has_lost_hand_process_and_guard_lets_go_of_the_hand",
        "            self._let_go_instead()",
    ),
    Guard(
        "a silent process of the hand may go on later",
        "tega/unit/test_hand_guard::a_run_that_has_lost_hand_process_and_guard_lets_go_of_the_hand",
        "                self._process.kill()  # it must not go on later",
        "                pass  #",
    ),
    Guard(
        "a hand is steered on after the computer slept",
        "tega/unit/test_hand_standstill::a_computer_that_slept_ends_the_hand_and_no_torque_of_before_is_sent",
        "                if standstill.pulse():",
    ),
    Guard(
        "a torque that was computed before a standstill is sent after it",
        "tega/unit/test_hand_standstill::a_computer_that_slept_ends_the_hand_and_no_torque_of_before_is_sent",
        "standstill.is_over if pushes else ",
    ),
    Guard(
        "the computer goes to sleep with the motors on",
        "tega/unit/test_hand_standstill::a_hand_is_let_go_before_the_computer_sleeps",
        "            self._on_sleep()",
    ),
    Guard(
        "a guard that gives up says nothing",
        "tega/unit/test_hand_guard::a_guard_that_gives_up_writes_to_the_system_s_log",
        '            alarm.end(why if gone else "")',
    ),
    Guard(
        "last words name a process without a look at it",
        "tega/unit/test_hand_guard::last_words_name_no_process_that_does_not_run",
        "        if guarded:",
        "        if seen.guard_pid or True:",
    ),
    Guard(
        "a Bluetooth vest's guard does not see a standstill",
        "tega_bench/test_vests::a_bluetooth_vest_that_was_silenced_in_a_standstill_is_felt_again",
        "STUCK_S: Final = 1.0",
        "STUCK_S: Final = 1e6",
    ),
    Guard(
        "a Bluetooth vest's driver does not tell its guard that it lives",
        "tools/test_soak::a_soak_of_one_fault_passes[stop-program]",
        "        if self.guard is not None:\n            self.guard.beat()",
        "        pass",
    ),
    Guard(
        "the dead-man is not asked on the way to the start",
        "tega_study/test_arm_to_start::the_emulated_arm_and_hand_go_to_their_start_while_the_switch_is_held",
        "dead_man and turn.",
    ),
    Guard(
        "the way to the start goes on without a guard of the hand",
        "tega_study/test_arm_to_start::the_way_to_the_start_holds_while_the_hand_s_guard_is_lost",
        "may_move=lambda: time.monotonic() >= warned_until_s and not hand.unguarded,",
        "may_move=lambda: time.monotonic() >= warned_until_s,",
    ),
    Guard(
        "the loss of the arm's process is not seen",
        "tega/unit/test_arm_run::an_arm_whose_process_is_killed_stops_and_the_run_goes_on",
        '        if arm.phase in {"faulted", "gone"} and (text := arm.problem):',
        '        if arm.phase == "faulted" and (text := arm.problem):',
    ),
    Guard(
        "the loss of the recorder's process is not told",
        "tega/unit/test_recording::"
        "a_killed_process_stops_the_recording_with_a_word_and_the_file_is_recovered",
        "                self._stop(self._gone())\n            self._queue.close()",
        "                pass\n            self._queue.close()",
    ),
    Guard(
        "a negative dose lengthens the day",
        "together/test_dose_file::a_number_that_would_lengthen_the_day_is_refused",
        "_AtLeast0 = Annotated[float, msgspec.Meta(ge=0)]",
        "_AtLeast0 = float",
    ),
    Guard(
        "any machine may be the Player's",
        "tega_bench/test_vest_player::another_machine_is_asked_only_where_the_settings_say_so",
        "    if not (o.allow_remote or _is_here(o.host)):",
    ),
    Guard(
        "the working folder comes first for programs that are started",
        "tega/unit/test_hand_guard::files_in_the_working_folder_do_not_take_the_guard_s_place",
        'sys.executable, "-P", "-c", _BEGIN',
        'sys.executable, "-c", _BEGIN',
    ),
    Guard(
        "the guard of the hand is dismissed whatever the hand says",
        "tega/unit/test_hand_guard::a_deaf_hand_is_not_left_alone",
        "        if self._let_go:\n            if guard is not None:",
        "        if True:\n            if guard is not None:",
    ),
    Guard(
        "nobody sees that the guard of the hand is gone",
        "hazards/test_lost::the_loss_of_the_hand_s_guard_holds_until_there_is_another",
        '            self.problem = f"the process that {self._subject} was lost; another is being started"',
        "            return",
    ),
    Guard(
        "a guard that takes a lost one's place at the end is dismissed whatever the device says",
        "tega/unit/test_hand_standstill::a_device_that_is_left_while_its_guard_is_replaced_is_let_go_of",
        "                if closing:\n                    self._part_from(process)",
        '                if closing:\n                    self._write(b"done\\n", process)',
    ),
    Guard(
        "a guard that dies as the device is left to it is taken for one that has it",
        "tega/unit/test_hand_standstill::a_device_that_is_left_before_its_guard_s_loss_is_seen_is_let_go_of[killed]",
        " and (self._safe or self._has_it.is_set())",
    ),
    Guard(
        "a device is left to a guard that stands still",
        "tega/unit/test_hand_standstill::"
        "a_device_that_is_left_before_its_guard_s_loss_is_seen_is_let_go_of[stopped]",
        "            self._process.kill()  # it stands still: the thread that watches it starts another",
    ),
)
