"""Heads and rows of the tables come from the records."""

from __future__ import annotations

from tega.records import BusFrame, Contact, HandCommand, Intent, VestFrame
from tega.records.table import columns, numbers, rows
from tega.runtime.files.csv_writer import time_text


def test_a_table_has_the_columns_of_its_record() -> None:
    assert columns(Contact) == Contact.table
    assert columns(Intent, channels=("ch3", "ch6")) == ("t_s", "ch3", "ch6", "fused", "closure", "confidence")
    assert columns(VestFrame, intensities=("m0", "m4")) == ("t_s", "m0", "m4")
    assert columns(HandCommand) == ("t_s", "id", "data")


def test_a_row_has_as_many_cells_as_its_table_has_columns() -> None:
    contact = Contact(finger="thumb", t_ns=1_500_000, in_contact=True, cci=0.1, eda=3)
    assert rows(contact) == [f"{time_text(1_500_000)},thumb,0.1,3,0.0,0.0,0.0,1,0.0,0.0,,,,,\n"]
    assert rows(contact)[0].count(",") == len(columns(Contact)) - 1
    assert rows(Intent(t_ns=0, channels=(2, 5), level=3))[0].endswith(",2,5,3,,\n")
    requested = HandCommand(t_ns=0, level=1, frames=(BusFrame(0x180, b"\x01\xff"), BusFrame(0x20, b"", True)))
    assert [row.split(",", 1)[1] for row in rows(requested)] == ["180,01FF\n", "020,R\n"]


def test_numbers_kept_in_memory_are_those_of_the_row_with_the_time_in_seconds() -> None:
    intent = Intent(t_ns=1_500_000_000, channels=(2, 5), level=3, closure=0.5, confidence=0.25)
    assert numbers(intent) == (1.5, 2, 5, 3, 0.5, 0.25)
