"""What a run leaves in its output folder: files of a batch, links and statuses of pages."""
