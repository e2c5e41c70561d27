"""Record a run: a session's MCAP files, and an output folder with tables and a summary."""

from __future__ import annotations

from tega.recording.folder import OUTPUT_NAMES, prepare_folder
from tega.recording.tables import TABLES, RecordTable
from tega.runtime.files.csv_writer import CsvWriter, time_text

__all__ = ["OUTPUT_NAMES", "TABLES", "CsvWriter", "RecordTable", "prepare_folder", "time_text"]
