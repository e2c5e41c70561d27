"""Parse the command line: a verb's module is imported when the verb is called."""
