"""A live demonstration: the session, its page in the browser, and what it shows."""
