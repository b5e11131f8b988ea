"""What each stage of the workflow does: settings and files in, files and numbers out."""
