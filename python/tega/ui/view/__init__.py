"""Draw a session: figures from recordings and the terminal's live view."""
