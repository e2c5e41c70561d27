"""The guards of reflex, muscles, cameras, vest, hand and arm, and of the processes that watch them."""

from __future__ import annotations

from typing import Final

from hazards.guard import HAND, LOST, MUSCLES, REFLEX, STAND, START, STOP, TIMES, VESTS, Guard

OF_DEVICES: Final = (
    Guard(
        "the reflex's sum has no bound",
        "self.added = min(max(added, 0.0), self._s.most_levels, _CLOSED - own)",
        "self.added = added",
        f"{REFLEX}a_closed_hand_is_told_no_more_than_closed",
    ),
    Guard(
        "the reflex firms the grip at once",
        "self.added + self._s.rise_levels_per_s * dt_s)",
        "9.0)",
        f"{REFLEX}the_addition_is_bounded_slow_and_never_below_the_person_s_own_closure",
    ),
    Guard(
        "the reflex needs no authority",
        "target = authority * self._s.most_levels * max(wish, 0.0)",
        "target = self._s.most_levels * max(wish, 0.0)",
        f"{REFLEX}a_slip_firms_the_grip_by_its_share_and_the_addition_decays_when_it_ends",
    ),
    Guard(
        "the reflex holds what somebody opens the hand for",
        "        if own <= _OPEN:\n            added = 0.0",
        "        if False:\n            added = 0.0",
        f"{REFLEX}who_opens_the_hand_lets_go_at_once",
    ),
    Guard(
        "the reflex answers the slip of what is let go",
        "held_back = not now.allowed or self._firmest - own >= _LOOSENED",
        "held_back = not now.allowed",
        f"{REFLEX}who_loosens_the_grip_is_not_held_against_it_by_the_slip_that_follows",
    ),
    Guard(
        "the reflex goes on in a hold",
        "held_back = not now.allowed or self._firmest - own >= _LOOSENED",
        "held_back = self._firmest - own >= _LOOSENED",
        f"{TIMES}what_a_reflex_added_is_taken_back_within_200_ms_of_a_hold",
    ),
    Guard(
        "the reflex firms a grip that no finger feels",
        "holding = own > _OPEN and any(contact.in_contact for contact in fresh.values())",
        "holding = own > _OPEN",
        f"{REFLEX}a_wish_counts_for_nothing_while_no_finger_touches",
    ),
    Guard(
        "EMG that is lost is not seen",
        "        if age_ns > stale_ns:",
        '        if age_ns > stale_ns and stream.kind != "emg":',
        f"{MUSCLES}emg_unplugged_holds_the_level_then_opens_the_hand",
    ),
    Guard(
        "a hold lasts for ever",
        'give_up_ns=round(s.hold_ms * 1e6) if s.then == "open" else None',
        "give_up_ns=None",
        f"{MUSCLES}emg_unplugged_holds_the_level_then_opens_the_hand",
    ),
    Guard(
        '`then = "keep"` is not heeded',
        'round(s.hold_ms * 1e6) if s.then == "open" else None',
        "round(s.hold_ms * 1e6)",
        f"{MUSCLES}emg_lost_keeps_the_level_where_the_settings_say_so",
    ),
    Guard(
        "a board that went away is not looked for",
        "            if not opened_again(source, stopped):",
        "            if True:",
        f"{MUSCLES}emg_that_comes_back_steers_again",
    ),
    Guard(
        "a board's rate is taken on trust",
        "if abs(measured_hz / rate_hz - 1) <= RATE_TOLERANCE:",
        "if True:",
        f"{MUSCLES}a_slow_board_is_refused",
    ),
    Guard(
        "a finger's last picture stays on the vest",
        "if t_ns - contact.t_ns <= STALE_NS}",
        "if True}",
        f"{LOST}a_lost_camera_silences_its_column_and_no_other[pause-]",
    ),
    Guard(
        "a lost camera never holds",
        'if stream.kind == "emg" or s.tactile_lost == "hold":',
        'if stream.kind == "emg":',
        f"{LOST}a_lost_camera_holds_the_hand_where_the_settings_say_so[pause-]",
    ),
    Guard(
        "nobody asks for a stream's rate",
        "            elif text := self._slow(stream):",
        '            elif text := "":',
        f"{LOST}a_slow_camera_does_not_arm",
    ),
    Guard(
        "a live run needs no calibration",
        "            if source is not None and source.info.live:",
        "            if False:",
        f"{LOST}without_calibration_nothing_starts",
    ),
    Guard(
        "the loop does not ask how the hand is",
        "        self._check().say(level, added)",
        "        (self._end or self._check()).say(level, added)",
        f"{LOST}a_silent_hand_ends_the_run",
    ),
    Guard(
        "the loop does not ask how the hand is",
        "        self._check().say(level, added)",
        "        (self._end or self._check()).say(level, added)",
        f"{LOST}a_hand_in_trouble_is_let_go_and_the_vest_rests",
    ),
    Guard(
        "the dead-man is not asked",
        "is not None and not dead_man.held:",
        "is not None and False:",
        f"{LOST}a_released_dead_man_holds",
    ),
    Guard(
        "a dead-man that says nothing counts as held",
        "if t_ns - self._received_ns > limit_ms * 1e6:",
        "if False:",
        f"{LOST}a_dead_man_that_freezes_while_it_is_held_holds",
    ),
    Guard(
        "nobody looks whether the vest is there",
        "if worn else {}",
        "if False else {}",
        f"{LOST}a_lost_vest_is_told_and_the_run_goes_on",
    ),
    Guard(
        "a lost vest never holds",
        'if s.vest_lost == "hold":',
        "if False:",
        f"{LOST}a_lost_vest_holds_the_hand_where_the_settings_say_so",
    ),
    Guard(
        "a late loop goes on as if nothing were",
        "        return late_ns > self._late_ns and bool(self._streams or self._vests)",
        "        return False",
        f"{LOST}a_late_loop_holds_and_the_vest_rests_meanwhile",
    ),
    Guard(
        "the vest has no watchdog",
        "WATCHDOG_S: Final = 0.2",
        "WATCHDOG_S: Final = 1e6",
        f"{LOST}a_late_loop_holds_and_the_vest_rests_meanwhile",
    ),
    Guard(
        "a table that cannot be written is not told of",
        "        except Exception as error:  # whoever looks on must not end what it looks at",
        "        except ZeroDivisionError as error:",
        f"{STOP}a_full_disk_ends_the_tables_and_not_the_run",
    ),
    Guard(
        "no process guards the hand",
        "if o.guard and o.torque",
        "if False and o.torque",
        f"{HAND}a_killed_or_frozen_process_of_the_hand_does_not_leave_it_pushing",
    ),
    Guard(
        "the hand's process does not let go while the run stands still",
        "            if self._bus.switch_off(self._off, device_id=device_id, patience_s=_STILL_OFF_S):",
        "            if True:",
        f"{HAND}a_killed_or_frozen_program_without_a_guard_lets_go_of_the_hand",
    ),
    Guard(
        "the hand's process goes on while the run stands still",
        "return self._n_words, time.monotonic() - self._last_s",
        "return time.monotonic_ns(), 0.0",
        f"{STOP}a_killed_or_frozen_run_leaves_all_safe",
    ),
    Guard(
        "it does not see a standstill",
        "STUCK_S: Final = 1.0",
        "STUCK_S: Final = 1e6",
        f"{HAND}a_frozen_program_and_hand_process_do_not_leave_the_hand_pushing",
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
        f"{HAND}a_run_that_has_lost_hand_process_and_guard_lets_go_of_the_hand",
    ),
    Guard(
        "a silent process of the hand may go on later",
        "                self._process.kill()  # it must not go on later",
        "                pass  #",
        f"{HAND}a_run_that_has_lost_hand_process_and_guard_lets_go_of_the_hand",
    ),
    Guard(
        "a hand is steered on after the computer slept",
        "                if standstill.pulse():",
        "                if False:",
        f"{STAND}a_computer_that_slept_ends_the_hand",
    ),
    Guard(
        "a torque that was computed before a standstill is sent after it",
        "outdated=standstill.is_over if pushes else None",
        "outdated=None",
        f"{STAND}a_torque_that_was_computed_before_a_standstill_is_not_sent",
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
        f"{HAND}a_guard_that_gives_up_writes_to_the_system_s_log",
    ),
    Guard(
        "last words name a process without a look at it",
        "        if guard_runs(seen.guard_pid):",
        "        if seen.guard_pid or True:",
        f"{HAND}last_words_name_no_process_that_does_not_run",
    ),
    Guard(
        "a Bluetooth vest's guard does not see a standstill",
        "STUCK_S: Final = 1.0",
        "STUCK_S: Final = 1e6",
        f"{VESTS}a_bluetooth_vest_that_was_silenced_in_a_standstill_is_felt_again",
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
        f"{START}the_emulated_arm_and_hand_go_to_their_start_while_the_switch_is_held",
    ),
    Guard(
        "the way to the start goes on without a guard of the hand",
        "may_move=lambda: time.monotonic() >= warned_until_s and not hand.unguarded,",
        "may_move=lambda: time.monotonic() >= warned_until_s,",
        f"{START}the_way_to_the_start_holds_while_the_hand_s_guard_is_lost",
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
        f"{HAND}files_in_the_working_folder_do_not_take_the_guard_s_place",
    ),
    Guard(
        "the guard of the hand is dismissed whatever the hand says",
        "        if self._let_go:\n            if guard is not None:",
        "        if True:\n            if guard is not None:",
        f"{HAND}a_deaf_hand_is_not_left_alone",
    ),
    Guard(
        "nobody sees that the guard of the hand is gone",
        '            self.problem = f"the process that {self._subject} was lost; another is being started"',
        "            return",
        f"{LOST}the_loss_of_the_hand_s_guard_holds_until_there_is_another",
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
)
