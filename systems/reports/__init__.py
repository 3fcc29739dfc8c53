"""Reports for a person: replay pages, batch pages and terminal output. Never imports Drake."""
