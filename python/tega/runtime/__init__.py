"""Run a program: clocks, threads, child processes, plug-ins and optional packages."""
