"""Plan a user study, lead its trials, keep what happens, analyse it and report it.

::

    plan.py      study.toml and plan.csv, never changed once written
    order.py     order of conditions and objects for each participant, from a seed
    journal.py   a session's events, appended and synced one by one
    state.py     state derived from the events: finished trials, next trial
    lead/        leading a session through its trials
    observe/     a rater's console during a session
    observers.py the raters' files
    score/       agreement between accounts of the same trials; BORIS files
    ratings.py   participants' ratings
    attempt_rows.py each fingertip, frame by frame; hand and arm
    privacy.py   withdrawal and the anonymised copy
    trials.py    one row a trial, with the events it comes from
    rank.py people.py counts.py coupling.py power.py    the statistics, each with its source
    analyse.py   all numbers of a report in one record
    figures.py tables.py page.py report.py    the record as figures, CSV and one HTML file
    silico/      the whole study with simulated people

Example::

    from tega_study.plan import make_plan, write_plan
    write_plan(make_plan(participants=12, seed=7), Path("study"))
"""
