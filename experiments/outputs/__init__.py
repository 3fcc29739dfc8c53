"""What commands write: checks before the work, locks, and folders of files of one request; without Drake."""
