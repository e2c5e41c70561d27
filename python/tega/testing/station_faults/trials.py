FAULTS=Fault=Outcome=try_fault=None
