"""The command line: one verb a file, no logic; a verb's module is imported when the verb is called."""
