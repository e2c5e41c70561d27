"""Plan a user study, lead its trials, keep what happens, analyse it and report it.

A plan (``plan``) never changes once written; all else of a session is events (``journal``), from which state, trials
and agreements are derived. ``analyse`` has all numbers of a report in one record; ``silico`` runs the whole study with
simulated people.

Example::

    from tega_study.plan import make_plan, write_plan
    write_plan(make_plan(participants=12, seed=7), Path("study"))
"""
