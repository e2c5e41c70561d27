"""Plan a user study, lead its trials, keep what happens, analyse it and report it.

::

    plan.py order.py      study.toml and plan.csv, never changed once written; orders from a seed
    journal.py            a session's events, appended and synced one by one
    state.py trials.py    from the events: which trial is next; one row a trial
    observers.py detecting.py    accounts of others: raters, scene camera, detector
    lead/ observe/        leading a session through its trials; a rater's console meanwhile
    score/                agreement between accounts of the same trials; BORIS files
    study_notes.py privacy.py    withdrawal and the anonymised copy
    side_scores.py ratings.py    beeps, squeezes, tiring muscles, questions
    rank.py people.py coupling.py power.py    the statistics, each with its source
    analyse.py            all numbers of a report in one record
    figures.py tables.py page.py report.py    the record as figures, CSV and one HTML file
    silico/               the whole study with simulated people

Example::

    from tega_study.plan import make_plan, write_plan
    write_plan(make_plan(participants=12, seed=7), Path("study"))
"""
