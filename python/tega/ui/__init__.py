"""Show a session and take commands: the command line, the terminal view and the browser page."""
