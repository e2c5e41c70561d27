"""Parse the command line: one verb a file; a verb's module is imported when the verb is called."""
